// Files written directly by a thread of their own: the same bytes as written at once, whatever the sizes and the order.
#include "io/write_behind.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"
#include "tests/support/temporary_folder.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes_of(FileSystem& fs, const std::string& path) {
  const auto file = fs.open(path, ReadMode::kBuffered);
  EXPECT_TRUE(file.ok());
  Bytes out(file.value()->size_bytes());
  EXPECT_TRUE(file.value()->read_at(0, out).ok());
  return out;
}

/// Appends pieces of odd sizes, more than the buffers hold, and now and then overwrites what came before.
Bytes write_pieces(FileSystem& fs, const std::string& path, WriteMode mode) {
  auto file = AtomicFile::create(fs, path, mode);
  EXPECT_TRUE(file.ok());
  Bytes expected;
  for (uint32_t i = 0; i < 40; ++i) {
    const Bytes piece = pattern_bytes(i % 7 == 3 ? kWriteBehindBufferBytes + 5 : 1 + i * 9973, i, 0);
    EXPECT_TRUE(file.value().append(piece).ok());
    expected.insert(expected.end(), piece.begin(), piece.end());
    if (i % 5 != 4) continue;
    const Bytes patch = pattern_bytes(10001, 100 + i, 0);
    for (const uint64_t offset : {uint64_t{i} * 4099, expected.size() - patch.size() - 1}) {
      EXPECT_TRUE(file.value().write_at(offset, patch).ok());
      std::copy(patch.begin(), patch.end(), expected.begin() + static_cast<std::ptrdiff_t>(offset));
    }
  }
  const Bytes last = pattern_bytes(100, 99, 0);  // half over the end, then past it
  EXPECT_TRUE(file.value().write_at(expected.size() - 50, last).ok());
  EXPECT_TRUE(file.value().write_at(expected.size() + 10000, last).ok());
  const size_t end = expected.size();
  expected.resize(end + 10100);
  std::copy(last.begin(), last.end(), expected.begin() + static_cast<std::ptrdiff_t>(end - 50));
  std::copy(last.begin(), last.end(), expected.begin() + static_cast<std::ptrdiff_t>(end + 10000));
  EXPECT_EQ(file.value().size_bytes(), expected.size());
  EXPECT_TRUE(file.value().commit().ok());
  return expected;
}

TEST(WriteBehind, WritesTheSameBytesInBothModes) {
  const testing::TemporaryFolder folder;
  MemoryFileSystem memory;
  for (const WriteMode mode : {WriteMode::kBuffered, WriteMode::kDirect}) {
    const Bytes expected = write_pieces(posix_file_system(), folder / "a", mode);
    EXPECT_EQ(bytes_of(posix_file_system(), folder / "a"), expected);
    write_pieces(memory, "a", mode);
    EXPECT_EQ(memory.contents("a"), expected);
  }
  EXPECT_EQ(folder.names(), std::vector<std::string>{"a"});
}

TEST(WriteBehind, AFileOfNoBytesIsAFile) {
  const testing::TemporaryFolder folder;
  auto file = AtomicFile::create(posix_file_system(), folder / "a", WriteMode::kDirect);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file.value().commit().ok());
  EXPECT_TRUE(bytes_of(posix_file_system(), folder / "a").empty());
}

TEST(WriteBehind, AFileLetGoWhileItIsWrittenLeavesNothing) {
  const testing::TemporaryFolder folder;
  const Bytes piece = pattern_bytes(kWriteBehindBufferBytes, 1, 0);
  for (int pieces = 0; pieces < 5; ++pieces) {
    auto file = AtomicFile::create(posix_file_system(), folder / "a", WriteMode::kDirect);
    ASSERT_TRUE(file.ok());
    for (int i = 0; i < pieces; ++i) ASSERT_TRUE(file.value().append(piece).ok());
    const AtomicFile moved = std::move(file).value();
  }
  EXPECT_TRUE(folder.names().empty());
}

TEST(WriteBehind, AnErrorOfTheDiskComesBackFromALaterCallAndStays) {
  const Bytes piece = pattern_bytes(kWriteBehindBufferBytes, 1, 0);
  for (uint64_t call = 0; call < 3; ++call) {
    MemoryFileSystem memory;
    FaultyFileSystem fs(memory);
    {
      auto file = AtomicFile::create(fs, "a", WriteMode::kDirect);
      ASSERT_TRUE(file.ok());
      fs.arm(Fault::kDiskFull, call);
      uint64_t appended = 0;
      while (file.value().append(piece).ok()) ASSERT_LE(++appended, call + 2);
      fs.arm(Fault::kNone, 0);
      for (const Status& status : {file.value().append(piece), file.value().write_at(0, piece),
                                   file.value().commit()}) {
        ASSERT_FALSE(status.ok());
        EXPECT_EQ(status.error().code, ErrorCode::kStorage);
        EXPECT_NE(status.error().message.find("disk full"), std::string::npos) << status.error().message;
      }
    }
    EXPECT_TRUE(memory.names().empty());
  }
}

}  // namespace
}  // namespace shoal
