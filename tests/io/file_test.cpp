#include "io/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

class File : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (stdfs::temp_directory_path() / "shoal_file_test_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    directory_ = name;
  }
  void TearDown() override { stdfs::remove_all(directory_); }
  std::string path(const std::string& name) const { return directory_ + "/" + name; }
  size_t file_count() const {
    return static_cast<size_t>(std::distance(stdfs::directory_iterator(directory_), stdfs::directory_iterator()));
  }

  FileSystem& fs_ = posix_file_system();
  std::string directory_;
};

TEST_F(File, ReadsAnyRangeInBothModes) {
  const auto bytes = pattern_bytes(700001, 5, 0);
  ASSERT_TRUE(write_whole_file(fs_, path("a"), bytes).ok());
  for (const ReadMode mode : {ReadMode::kBuffered, ReadMode::kDirect}) {
    const auto file = fs_.open(path("a"), mode);
    ASSERT_TRUE(file.ok());
    ASSERT_EQ(file.value()->size_bytes(), bytes.size());
    alignas(4096) static std::byte out[700001 + 4096];
    const uint64_t offsets[] = {0, 1, 511, 4095, 4096, 8192, 300000, 696320, 700000, 700001};
    const uint64_t sizes[] = {0, 1, 100, 4096, 4097, 8192, 262144, 262145, 700001};
    for (const uint64_t offset : offsets) {
      for (const uint64_t size : sizes) {
        for (const uint64_t shift : {0, 1, 64}) {
          const auto status = file.value()->read_at(offset, std::span(out + shift, size));
          if (offset + size > bytes.size()) {
            EXPECT_FALSE(status.ok());
            continue;
          }
          ASSERT_TRUE(status.ok()) << status.error().message;
          ASSERT_EQ(std::memcmp(out + shift, bytes.data() + offset, size), 0) << offset << " " << size;
        }
      }
    }
  }
}

TEST_F(File, NamesWhatItExpectedAndFoundAtTheEnd) {
  ASSERT_TRUE(write_whole_file(fs_, path("a"), pattern_bytes(100, 1, 0)).ok());
  const auto file = fs_.open(path("a"), ReadMode::kBuffered);
  std::byte out[50];
  const auto status = file.value()->read_at(80, out);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kStorage);
  EXPECT_EQ(status.error().message,
            "cannot read " + path("a") + " at offset 80: expected 50 bytes, found 20 (end of file)");
  EXPECT_FALSE(file.value()->read_at(~0ull - 10, out).ok());
}

TEST_F(File, SeesThatAFileShrankAfterItWasOpened) {
  ASSERT_TRUE(write_whole_file(fs_, path("a"), pattern_bytes(20000, 1, 0)).ok());
  for (const ReadMode mode : {ReadMode::kBuffered, ReadMode::kDirect}) {
    const auto file = fs_.open(path("a"), mode);
    stdfs::resize_file(path("a"), 5000);
    std::vector<std::byte> out(20000);
    const auto status = file.value()->read_at(0, out);
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.error().message.find("expected 20000 bytes, found 5000"), std::string::npos)
        << status.error().message;
    stdfs::resize_file(path("a"), 20000);
  }
}

TEST_F(File, RefusesWhatIsNoFile) {
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  for (const ReadMode mode : {ReadMode::kBuffered, ReadMode::kDirect}) {
    for (const std::string& name :
         {path("missing"), directory_, path("fifo"), path("fifo/x"), std::string("/dev/zero")}) {
      const auto file = fs_.open(name, mode);
      ASSERT_FALSE(file.ok()) << name;
      EXPECT_EQ(file.error().code, ErrorCode::kInput);
      EXPECT_NE(file.error().message.find(name), std::string::npos);
    }
  }
}

TEST_F(File, CallsAFullDiskByItsName) {
  if (!stdfs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  auto file = fs_.create("/dev/full", WriteMode::kBuffered);
  ASSERT_TRUE(file.ok());
  const auto status = file.value()->write_at(0, pattern_bytes(10, 1, 0));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kStorage);
  EXPECT_NE(status.error().message.find("disk full"), std::string::npos) << status.error().message;
}

TEST_F(File, FailsToCreateInAMissingDirectory) {
  const auto file = AtomicFile::create(fs_, path("missing/a"));
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(file.error().code, ErrorCode::kStorage);
}

TEST_F(File, AnAtomicFileAppearsWholeOrNotAtAll) {
  {
    auto file = AtomicFile::create(fs_, path("a"));
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file.value().append(pattern_bytes(10, 1, 0)).ok());
    ASSERT_TRUE(file.value().append(pattern_bytes(10, 2, 0)).ok());
    ASSERT_TRUE(file.value().write_at(0, pattern_bytes(3, 3, 0)).ok());
    EXPECT_EQ(file.value().size_bytes(), 20u);
    EXPECT_FALSE(stdfs::exists(path("a")));
    EXPECT_EQ(file_count(), 1u);
    const AtomicFile moved = std::move(file).value();
  }
  EXPECT_EQ(file_count(), 0u);
  auto file = AtomicFile::create(fs_, path("a"));
  ASSERT_TRUE(file.value().append(pattern_bytes(10, 1, 0)).ok());
  auto other = AtomicFile::create(fs_, path("a"));
  ASSERT_TRUE(other.value().append(pattern_bytes(30, 1, 0)).ok());
  ASSERT_TRUE(file.value().commit().ok());
  EXPECT_EQ(stdfs::file_size(path("a")), 10u);
  ASSERT_TRUE(other.value().commit().ok());
  EXPECT_EQ(stdfs::file_size(path("a")), 30u);
  EXPECT_EQ(file_count(), 1u);
}

TEST_F(File, AnAtomicFileAssignedOverLeavesNoTemporary) {
  {
    auto first = AtomicFile::create(fs_, path("a"));
    auto second = AtomicFile::create(fs_, path("b"));
    first.value() = std::move(second).value();
    ASSERT_TRUE(first.value().commit().ok());
  }
  EXPECT_EQ(file_count(), 1u);
  EXPECT_TRUE(stdfs::exists(path("b")));
}

TEST_F(File, FailingToReplaceADirectoryLeavesNoTemporary) {
  stdfs::create_directory(path("a"));
  EXPECT_EQ(write_whole_file(fs_, path("a"), pattern_bytes(10, 1, 0)).error().code, ErrorCode::kStorage);
  EXPECT_EQ(file_count(), 1u);
}

TEST_F(File, ReadsASmallFileWholeAndRefusesALargerOne) {
  const std::string text = "twelve bytes";
  ASSERT_TRUE(write_whole_file(fs_, path("a"), std::as_bytes(std::span(text.data(), text.size()))).ok());
  EXPECT_EQ(read_whole_file(fs_, path("a"), 12).value(), text);
  EXPECT_EQ(read_whole_file(fs_, path("a"), 11).error().code, ErrorCode::kInput);
  EXPECT_EQ(read_whole_file(fs_, path("b"), 11).error().code, ErrorCode::kInput);
  ASSERT_TRUE(write_whole_file(fs_, path("empty"), {}).ok());
  EXPECT_EQ(read_whole_file(fs_, path("empty"), 0).value(), "");
}

TEST(FileFaults, AWriteThatFailsAtAnyCallLeavesNoFile) {
  for (const Fault fault : {Fault::kIoError, Fault::kDiskFull}) {
    uint64_t call = 0;
    for (;; ++call) {
      MemoryFileSystem memory;
      FaultyFileSystem fs(memory);
      fs.arm(fault, call);
      if (write_whole_file(fs, "d/a", pattern_bytes(100, 1, 0)).ok()) break;
      EXPECT_TRUE(memory.names().empty()) << call;
    }
    EXPECT_EQ(call, 4u);  // create, write, sync, rename
  }
}

}  // namespace
}  // namespace shoal
