#include "io/async_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <set>
#include <thread>

#include "io/aligned_buffer.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

constexpr unsigned kDepth = 8;
constexpr uint64_t kPieceBytes = 8192;
constexpr uint64_t kFileBytes = 40 * kPieceBytes;

std::vector<std::byte> content() { return pattern_bytes(kFileBytes, 5, 0); }

/// Reads every piece, several at once, and compares.
void read_all(AsyncReader& reader, ReadableFile& file) {
  const std::vector<std::byte> expected = content();
  AlignedBuffer memory;
  const auto buffers = memory.reserve(kDepth * kPieceBytes).value();
  std::vector<uint64_t> offset_of(kDepth);
  const auto submit = [&](uint32_t tag, uint64_t offset) {
    offset_of[tag] = offset;
    reader.submit({&file, offset, buffers.subspan(tag * kPieceBytes, kPieceBytes), tag});
  };
  uint64_t next = 0, done = 0;
  for (uint32_t tag = 0; tag < kDepth; ++tag, next += kPieceBytes) submit(tag, next);
  while (done < kFileBytes) {
    const auto completion = reader.wait();
    ASSERT_TRUE(completion.has_value());
    ASSERT_TRUE(completion->status.ok()) << completion->status.error().message;
    const uint32_t tag = completion->tag;
    EXPECT_EQ(std::memcmp(&buffers[tag * kPieceBytes], &expected[offset_of[tag]], kPieceBytes), 0);
    done += kPieceBytes;
    if (next < kFileBytes) submit(tag, next), next += kPieceBytes;
  }
}

class ReadersOfARealFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("shoal-async-" + std::to_string(::getpid()))).string();
    ASSERT_TRUE(write_whole_file(posix_file_system(), path_, content()).ok());
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string path_;
};

TEST_F(ReadersOfARealFile, GiveTheBytesWithUring) {
  const auto reader = make_uring_reader(kDepth);
  if (reader == nullptr) GTEST_SKIP() << "the system refuses io_uring";
  for (const ReadMode mode : {ReadMode::kDirect, ReadMode::kBuffered}) {
    const auto file = posix_file_system().open(path_, mode);
    ASSERT_TRUE(file.ok());
    read_all(*reader, *file.value());
  }
}

TEST_F(ReadersOfARealFile, GiveTheBytesWithThreads) {
  const auto reader = make_thread_reader(kDepth, 3);
  const auto file = posix_file_system().open(path_, ReadMode::kDirect);
  ASSERT_TRUE(file.ok());
  read_all(*reader, *file.value());
}

TEST_F(ReadersOfARealFile, SayWhereAFileThatWasCutShortEnds) {
  const auto file = posix_file_system().open(path_, ReadMode::kDirect);
  ASSERT_TRUE(file.ok());
  std::filesystem::resize_file(path_, kFileBytes / 2);
  AlignedBuffer memory;
  const auto out = memory.reserve(kPieceBytes).value();
  for (auto& reader : {make_uring_reader(kDepth), make_thread_reader(kDepth, 1)}) {
    if (reader == nullptr) continue;
    reader->submit({file.value().get(), kFileBytes - kPieceBytes, out, 0});
    const auto completion = reader->wait();
    ASSERT_TRUE(completion.has_value());
    ASSERT_FALSE(completion->status.ok()) << reader->name();
    EXPECT_EQ(completion->status.error().code, ErrorCode::kStorage);
    EXPECT_NE(completion->status.error().message.find(path_), std::string::npos);
  }
}

TEST(AsyncReader, ReadsFilesWithoutADescriptorByThreads) {
  MemoryFileSystem fs;
  ASSERT_TRUE(write_whole_file(fs, "a", content()).ok());
  const auto file = fs.open("a", ReadMode::kDirect);
  ASSERT_TRUE(file.ok());
  EXPECT_LT(file.value()->descriptor(), 0);
  read_all(*make_thread_reader(kDepth, 4), *file.value());
}

TEST(AsyncReader, HandsOnTheErrorOfARead) {
  MemoryFileSystem memory_fs;
  ASSERT_TRUE(write_whole_file(memory_fs, "a", content()).ok());
  FaultyFileSystem fs(memory_fs);
  const auto file = fs.open("a", ReadMode::kDirect);
  fs.arm(Fault::kIoError, 0);
  AlignedBuffer memory;
  const auto reader = make_thread_reader(kDepth, 2);
  reader->submit({file.value().get(), 0, memory.reserve(kPieceBytes).value(), 3});
  const auto completion = reader->wait();
  ASSERT_TRUE(completion.has_value());
  EXPECT_EQ(completion->tag, 3u);
  ASSERT_FALSE(completion->status.ok());
  EXPECT_EQ(completion->status.error().code, ErrorCode::kStorage);
}

TEST(AsyncReader, AWakeEndsOneWait) {
  for (auto& reader : {make_uring_reader(kDepth), make_thread_reader(kDepth, 1)}) {
    if (reader == nullptr) continue;
    std::thread waiter([&] { EXPECT_FALSE(reader->wait().has_value()); });
    reader->wake();
    waiter.join();
  }
}

}  // namespace
}  // namespace shoal
