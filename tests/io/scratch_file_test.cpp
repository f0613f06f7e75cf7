#include "io/scratch_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"
#include "tests/support/temporary_folder.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

uint64_t disk_bytes(const std::string& path) {
  struct stat info {};
  EXPECT_EQ(::stat(path.c_str(), &info), 0);
  return static_cast<uint64_t>(info.st_blocks) * 512;
}

/// Bytes in use in the file system that holds `folder`.
uint64_t used_bytes(const std::string& folder) {
  struct statvfs info {};
  EXPECT_EQ(::statvfs(folder.c_str(), &info), 0);
  return uint64_t{info.f_blocks - info.f_bfree} * info.f_frsize;
}

void write_and_read_back(FileSystem& fs, const std::string& folder) {
  constexpr uint64_t kBlocks = 200;
  auto made = ScratchFile::create(fs, folder, kBlocks * kBlockBytes - 5);
  ASSERT_TRUE(made.ok()) << made.error().message;
  ScratchFile& file = *made.value();
  EXPECT_EQ(file.size_bytes(), kBlocks * kBlockBytes);
  AlignedBuffer memory;
  const auto aligned = memory.reserve(kBlocks * kBlockBytes + 1).value();
  for (const uint64_t shift : {0, 1}) {  // an aligned address and another
    const Bytes bytes = pattern_bytes(100 * kBlockBytes, 7 + shift, 0);
    std::memcpy(aligned.data() + shift, bytes.data(), bytes.size());
    const auto status = file.write_at(3 * kBlockBytes, aligned.subspan(shift, bytes.size()));
    ASSERT_TRUE(status.ok()) << status.error().message;
    for (const uint64_t offset : {0, 1, 4096, 4097, 300000}) {
      for (const uint64_t size : {0, 1, 4096, 8192, 20001, 100000}) {
        Bytes out(size);
        ASSERT_TRUE(file.read_at(3 * kBlockBytes + offset, out).ok());
        ASSERT_TRUE(std::equal(out.begin(), out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset)));
      }
    }
  }
  Bytes untouched(kBlockBytes, std::byte{1});
  ASSERT_TRUE(file.read_at(150 * kBlockBytes, untouched).ok());
  EXPECT_EQ(untouched, Bytes(kBlockBytes));
  EXPECT_EQ(file.written_bytes(), 200 * kBlockBytes);
  file.release(3 * kBlockBytes, 50 * kBlockBytes);
  Bytes kept(kBlockBytes);
  ASSERT_TRUE(file.read_at(53 * kBlockBytes, kept).ok());
  EXPECT_TRUE(std::equal(kept.begin(), kept.end(), aligned.data() + 1 + 50 * kBlockBytes));
}

TEST(ScratchFile, GivesBackWhatWasWrittenAtAnyAlignment) {
  const testing::TemporaryFolder folder;
  write_and_read_back(posix_file_system(), folder.path());
  EXPECT_TRUE(folder.names().empty());
}

TEST(ScratchFile, WorksWhereDirectAccessIsRefused) {
  if (!std::filesystem::exists("/dev/shm")) GTEST_SKIP() << "no memory file system here";
  write_and_read_back(posix_file_system(), "/dev/shm");
}

TEST(ScratchFile, WorksInMemory) {
  MemoryFileSystem fs;
  write_and_read_back(fs, "folder");
  EXPECT_TRUE(fs.names().empty());
}

TEST(ScratchFile, HasNoNameWhileItIsInUse) {
  const testing::TemporaryFolder folder;
  const auto file = ScratchFile::create(posix_file_system(), folder.path(), 1u << 20);
  ASSERT_TRUE(file.ok());
  EXPECT_TRUE(folder.names().empty());
}

TEST(ScratchFile, ThreadsWriteAndReadTheirOwnRanges) {
  const testing::TemporaryFolder folder;
  constexpr uint64_t kThreads = 4, kPieces = 32, kPieceBytes = 3 * kBlockBytes;
  const auto file = ScratchFile::create(posix_file_system(), folder.path(), kThreads * kPieces * kPieceBytes);
  ASSERT_TRUE(file.ok());
  std::vector<std::thread> threads;
  for (uint64_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (uint64_t i = 0; i < kPieces; ++i) {
        const uint64_t piece = i * kThreads + t;
        const Bytes bytes = pattern_bytes(kPieceBytes, static_cast<uint32_t>(piece), 0);
        EXPECT_TRUE(file.value()->write_at(piece * kPieceBytes, bytes).ok());
        Bytes out(kPieceBytes);
        EXPECT_TRUE(file.value()->read_at(piece * kPieceBytes, out).ok());
        EXPECT_EQ(out, bytes);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST(ScratchFile, NamesTheFolderThatIsMissingOrTakesNoFiles) {
  const testing::TemporaryFolder folder;
  std::ofstream(folder / "file") << "x";
  for (const std::string& bad : {folder / "missing", folder / "file", std::string("/proc")}) {
    const auto file = ScratchFile::create(posix_file_system(), bad, 1u << 20);
    ASSERT_FALSE(file.ok()) << bad;
    EXPECT_EQ(file.error().code, ErrorCode::kStorage);
    EXPECT_NE(file.error().message.find("scratch file of 1048576 bytes in " + bad), std::string::npos)
        << file.error().message;
  }
}

TEST(ScratchFile, FindsOutThatTheDiskIsTooSmallBeforeAnyWriting) {
  const testing::TemporaryFolder folder;
  const uint64_t before = used_bytes(folder.path());
  const uint64_t bytes = uint64_t{1} << 43;  // 8 TiB
  const auto file = ScratchFile::create(posix_file_system(), folder.path(), bytes);
  if (file.ok()) GTEST_SKIP() << "a disk of more than 8 TiB";
  EXPECT_EQ(file.error().code, ErrorCode::kStorage);
  EXPECT_NE(file.error().message.find("scratch file of 8796093022208 bytes in " + folder.path()), std::string::npos)
      << file.error().message;
  EXPECT_TRUE(folder.names().empty());
  EXPECT_LT(used_bytes(folder.path()), before + (uint64_t{1} << 36));  // nothing near 8 TiB is held
  EXPECT_EQ(ScratchFile::create(posix_file_system(), folder.path(), ~uint64_t{0}).error().code, ErrorCode::kStorage);
}

TEST(FileRelease, GivesBackWholeBlocksAndKeepsTheRest) {
  const testing::TemporaryFolder folder;
  const Bytes bytes = pattern_bytes(100 * kBlockBytes + 17, 3, 0);
  MemoryFileSystem memory;
  memory.put("part.bin", bytes);
  ASSERT_TRUE(write_whole_file(posix_file_system(), folder / "part.bin", bytes).ok());
  const uint64_t before = disk_bytes(folder / "part.bin");
  const std::pair<FileSystem*, std::string> places[] = {{&memory, "part.bin"},
                                                        {&posix_file_system(), folder / "part.bin"}};
  for (const auto& [fs, path] : places) {
    const auto given = fs->release(path, 10 * kBlockBytes - 1, 20 * kBlockBytes + 2);
    ASSERT_TRUE(given.ok()) << given.error().message;
    if (given.value() == 0) GTEST_SKIP() << "no holes in this file system";
    EXPECT_EQ(given.value(), 20 * kBlockBytes);
    auto expected = bytes;
    std::fill_n(expected.begin() + 10 * kBlockBytes, 20 * kBlockBytes, std::byte{0});
    Bytes out(bytes.size());
    ASSERT_TRUE(fs->open(path, ReadMode::kBuffered).value()->read_at(0, out).ok());
    EXPECT_EQ(out, expected);
    EXPECT_EQ(fs->release(path, 1, kBlockBytes).value(), 0u);
    EXPECT_EQ(fs->release("missing.bin", 0, kBlockBytes).error().code, ErrorCode::kStorage);
  }
  EXPECT_EQ(disk_bytes(folder / "part.bin"), before - 20 * kBlockBytes);
}

}  // namespace
}  // namespace shoal
