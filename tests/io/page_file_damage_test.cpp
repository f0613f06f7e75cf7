// Damaged, cut off, half written and hostile .shoal files.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "io/page_codec.h"
#include "io/page_format.h"
#include "io/write_behind.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

/// A table, an empty table, an lz4 page and a raw one.
Status write_small_file(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(auto writer, PageFileWriter::create(fs, path));
  SHOAL_RETURN_IF_ERROR(writer.append_table(7, pattern_bytes(100, 1, 0)));
  SHOAL_RETURN_IF_ERROR(writer.append_table(8, {}));
  SHOAL_RETURN_IF_ERROR(writer.append(PageKind::kTreelet, pattern_bytes(6000, 2, 50)));
  SHOAL_RETURN_IF_ERROR(writer.append(PageKind::kAttributes, pattern_bytes(4000, 3, 0)));
  return writer.finish();
}

/// More pages than the writer gathers before it writes: three writes before the end.
Status write_large_file(FileSystem& fs, const std::string& path) {
  const Bytes page = pattern_bytes(kWriteBehindBufferBytes, 4, 0);
  SHOAL_ASSIGN_OR_RETURN(auto writer, PageFileWriter::create(fs, path));
  for (int i = 0; i < 3; ++i) SHOAL_RETURN_IF_ERROR(writer.append(PageKind::kTreelet, page));
  return writer.finish();
}

Bytes small_file() {
  MemoryFileSystem fs;
  EXPECT_TRUE(write_small_file(fs, "a.shoal").ok());
  return fs.contents("a.shoal");
}

Status open_and_verify(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, PageFile::open(fs, path, ReadMode::kBuffered));
  return file->verify();
}

Status open_and_verify(Bytes bytes) {
  MemoryFileSystem fs;
  fs.put("a.shoal", std::move(bytes));
  return open_and_verify(fs, "a.shoal");
}

TEST(PageFileDamage, NoFlippedBitStaysUnseen) {
  const Bytes good = small_file();
  ASSERT_TRUE(open_and_verify(good).ok());
  for (size_t i = 0; i < good.size(); ++i) {
    Bytes bad = good;
    bad[i] ^= static_cast<std::byte>(1u << (i % 8));
    const Status status = open_and_verify(std::move(bad));
    ASSERT_FALSE(status.ok()) << "byte " << i;
    ASSERT_EQ(status.error().code, ErrorCode::kCorrupt) << "byte " << i << ": " << status.error().message;
    ASSERT_NE(status.error().message.find("a.shoal"), std::string::npos);
  }
}

TEST(PageFileDamage, RefusesAFileCutOffAnywhere) {
  const Bytes good = small_file();
  for (size_t size = 0; size < good.size(); ++size) {
    const Status status = open_and_verify(Bytes(good.begin(), good.begin() + static_cast<ptrdiff_t>(size)));
    ASSERT_FALSE(status.ok()) << size;
    ASSERT_EQ(status.error().code, ErrorCode::kCorrupt) << size << ": " << status.error().message;
  }
}

TEST(PageFileDamage, RefusesBytesThatWereAddedOrMoved) {
  const Bytes good = small_file();
  for (const size_t place : {size_t{0}, size_t{4096}, size_t{8192}, good.size() - 64, good.size()}) {
    for (const size_t count : {size_t{1}, size_t{64}, size_t{4096}}) {
      Bytes bad = good;
      bad.insert(bad.begin() + static_cast<ptrdiff_t>(place), count, std::byte{0});
      const Status status = open_and_verify(std::move(bad));
      ASSERT_FALSE(status.ok()) << place << " " << count;
      EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    }
  }
}

TEST(PageFileDamage, TellsAnotherFormatFromADamagedFile) {
  EXPECT_EQ(open_and_verify(Bytes(10000, std::byte{'x'})).error().code, ErrorCode::kInput);
  EXPECT_EQ(open_and_verify(Bytes(10, std::byte{'x'})).error().code, ErrorCode::kInput);
  MemoryFileSystem fs;
  EXPECT_EQ(open_and_verify(fs, "missing").error().code, ErrorCode::kInput);
}

/// Changes what is covered by checksums, and makes the checksums right again: a file from a stranger.
Bytes forge(const std::function<void(Superblock&, std::vector<PageRecord>&, Footer&)>& change) {
  const Bytes good = small_file();
  Superblock superblock;
  Footer footer;
  std::memcpy(&superblock, good.data(), sizeof(superblock));
  std::memcpy(&footer, good.data() + good.size() - sizeof(footer), sizeof(footer));
  std::vector<PageRecord> records(footer.page_count);
  std::memcpy(records.data(), good.data() + footer.directory_offset, footer.directory_bytes);
  Bytes bytes(good.begin(), good.begin() + static_cast<ptrdiff_t>(footer.directory_offset));
  change(superblock, records, footer);
  superblock.checksum = hash_bytes(std::as_bytes(std::span(&superblock, 1)).first(4088));
  std::memcpy(bytes.data(), &superblock, sizeof(superblock));
  for (PageRecord& r : records) {
    if (r.offset <= bytes.size() && r.stored_bytes <= bytes.size() - r.offset) {
      r.checksum = page_checksum(r, std::span(bytes).subspan(r.offset, r.stored_bytes));
    }
  }
  const auto directory = std::as_bytes(std::span(records));
  footer.directory_checksum = hash_bytes(directory);
  footer.superblock_checksum = superblock.checksum;
  footer.checksum = hash_bytes(std::as_bytes(std::span(&footer, 1)).first(56));
  bytes.insert(bytes.end(), directory.begin(), directory.end());
  const auto tail = std::as_bytes(std::span(&footer, 1));
  bytes.insert(bytes.end(), tail.begin(), tail.end());
  return bytes;
}

TEST(PageFileDamage, TheForgeItselfMakesASoundFile) {
  EXPECT_TRUE(open_and_verify(forge([](auto&, auto&, auto&) {})).ok());
}

TEST(PageFileDamage, RefusesHostileRecords) {
  const std::pair<const char*, std::function<void(std::vector<PageRecord>&)>> forgeries[] = {
      {"offset past the end", [](auto& r) { r[2].offset = 1ull << 62; }},
      {"offset that overflows", [](auto& r) { r[2].offset = ~0ull - 4095; }},
      {"unaligned offset", [](auto& r) { r[2].offset += 1; }},
      {"offset of the page before", [](auto& r) { r[3].offset = r[2].offset; }},
      {"offset into the directory", [](auto& r) { r[3].offset += 4096; }},
      {"offset in the superblock", [](auto& r) { r[0].offset = 0; }},
      {"pages out of order", [](auto& r) { std::swap(r[2], r[3]); }},
      {"wrong id", [](auto& r) { r[1].id = 0; }},
      {"more decoded bytes than allowed", [](auto& r) { r[2].raw_bytes = kMaxPageBytes + 1; }},
      {"more decoded bytes than lz4 can hold", [](auto& r) { r[2].raw_bytes = r[2].stored_bytes * 255 + 1; }},
      {"all decoded bytes there are", [](auto& r) { r[2].raw_bytes = ~0u; }},
      {"more stored than the file has", [](auto& r) { r[3].stored_bytes = r[3].raw_bytes = 1u << 20; }},
      {"no stored bytes", [](auto& r) { r[2].stored_bytes = 0; }},
      {"a treelet of no bytes", [](auto& r) { r[3].stored_bytes = r[3].raw_bytes = 0; }},
      {"raw with two sizes", [](auto& r) { r[3].raw_bytes += 1; }},
      {"lz4 that grows", [](auto& r) { r[3].codec = PageCodec::kLz4; }},
      {"another codec", [](auto& r) { r[3].codec = static_cast<PageCodec>(2); }},
      {"another kind", [](auto& r) { r[3].kind = static_cast<PageKind>(5); }},
      {"kind zero", [](auto& r) { r[3].kind = static_cast<PageKind>(0); }},
      {"reserved bytes used", [](auto& r) { r[1].reserved = 1; }},
      {"a treelet with a table's name", [](auto& r) { r[2].table = 7; }},
      {"a table twice", [](auto& r) { r[1].table = 7; }},
      {"lz4 bytes of another length", [](auto& r) { r[2].raw_bytes += 1; }},
      {"lz4 bytes cut off", [](auto& r) { r[2].stored_bytes -= 1; }},
  };
  for (const auto& [name, change] : forgeries) {
    const Status status = open_and_verify(forge([&](auto&, auto& records, auto&) { change(records); }));
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << name << ": " << status.error().message;
  }
}

TEST(PageFileDamage, RefusesHostileFooters) {
  const std::pair<const char*, std::function<void(Footer&)>> forgeries[] = {
      {"all pages there can be", [](auto& f) { f.page_count = ~0u; }},
      {"all pages and their bytes", [](auto& f) { f.directory_bytes = 40ull * (f.page_count = ~0u - 1); }},
      {"one page more", [](auto& f) { f.directory_bytes = 40ull * ++f.page_count; }},
      {"no pages", [](auto& f) { f.page_count = 0, f.directory_bytes = 0; }},
      {"directory elsewhere", [](auto& f) { f.directory_offset -= 4096; }},
      {"directory far away", [](auto& f) { f.directory_offset = ~0ull; }},
      {"directory of other size", [](auto& f) { f.directory_bytes += 40; }},
      {"another file size", [](auto& f) { f.file_bytes += 1; }},
      {"another version", [](auto& f) { f.version = 2; }},
  };
  for (const auto& [name, change] : forgeries) {
    const Status status = open_and_verify(forge([&](auto&, auto&, auto& footer) { change(footer); }));
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << name << ": " << status.error().message;
  }
}

TEST(PageFileDamage, NamesAVersionThatItCannotRead) {
  const Status status = open_and_verify(
      forge([](auto& superblock, auto&, auto& footer) { superblock.version = footer.version = 2; }));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInput);
  EXPECT_NE(status.error().message.find("version 2"), std::string::npos);
}

TEST(PageFileDamage, AFailedWriteLeavesNothingBehind) {
  for (const Fault fault : {Fault::kIoError, Fault::kDiskFull}) {
    uint64_t call = 0;
    for (;; ++call) {
      MemoryFileSystem memory;
      FaultyFileSystem fs(memory);
      fs.arm(fault, call);
      const Status status = write_large_file(fs, "dir/a.shoal");
      if (status.ok()) break;
      EXPECT_EQ(status.error().code, ErrorCode::kStorage);
      EXPECT_NE(status.error().message.find("a.shoal"), std::string::npos) << status.error().message;
      EXPECT_TRUE(memory.names().empty()) << "call " << call << " left " << memory.names().front();
    }
    EXPECT_EQ(call, 7u);  // create, four writes, sync, rename: all were harmed once
  }
}

TEST(PageFileDamage, AFailedWriteKeepsTheFileThatWasThere) {
  MemoryFileSystem memory;
  memory.put("dir/a.shoal", "before");
  FaultyFileSystem fs(memory);
  for (uint64_t call = 0;; ++call) {
    fs.arm(Fault::kIoError, call);
    if (write_small_file(fs, "dir/a.shoal").ok()) break;
    ASSERT_EQ(memory.names(), std::vector<std::string>{"dir/a.shoal"}) << call;
    ASSERT_EQ(memory.contents("dir/a.shoal").size(), 6u);
  }
  EXPECT_TRUE(open_and_verify(memory, "dir/a.shoal").ok());
}

TEST(PageFileDamage, AWriterThatFailedStaysFailed) {
  MemoryFileSystem memory;
  FaultyFileSystem fs(memory);
  auto writer = PageFileWriter::create(fs, "a.shoal");
  ASSERT_TRUE(writer.ok());
  fs.arm(Fault::kDiskFull, 0);
  const Bytes page = pattern_bytes(kWriteBehindBufferBytes, 1, 0);
  bool failed = false;
  for (int i = 0; i < 3 && !failed; ++i) failed = !writer.value().append(PageKind::kTreelet, page).ok();
  EXPECT_TRUE(failed);  // the page itself was written later, by another thread: a page after it hears of it
  fs.arm(Fault::kNone, 0);
  EXPECT_FALSE(writer.value().append(PageKind::kTreelet, pattern_bytes(10, 1, 0)).ok());
  EXPECT_FALSE(writer.value().finish().ok());
  EXPECT_FALSE(memory.exists("a.shoal"));
}

TEST(PageFileDamage, AKilledWriterLeavesAFileThatIsRefused) {
  MemoryFileSystem fs;
  auto writer = PageFileWriter::create(fs, "a.shoal");
  ASSERT_TRUE(writer.ok());
  const Bytes page = pattern_bytes(kWriteBehindBufferBytes, 1, 0);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer.value().append(PageKind::kTreelet, page).ok());
  ASSERT_EQ(fs.names().size(), 1u);
  fs.put("killed.shoal", fs.contents(fs.names().front()));
  ASSERT_GT(fs.contents("killed.shoal").size(), kWriteBehindBufferBytes - 1);
  EXPECT_EQ(open_and_verify(fs, "killed.shoal").error().code, ErrorCode::kCorrupt);
}

TEST(PageFileDamage, ReadFaultsAtEveryCallAreReported) {
  MemoryFileSystem memory;
  ASSERT_TRUE(write_small_file(memory, "a.shoal").ok());
  FaultyFileSystem fs(memory);
  for (const Fault fault : {Fault::kIoError, Fault::kShortRead, Fault::kBitFlip}) {
    uint64_t call = 0;
    for (;; ++call) {
      fs.arm(fault, call);
      const Status status = open_and_verify(fs, "a.shoal");
      if (fs.calls() <= call) {
        EXPECT_TRUE(status.ok());
        break;
      }
      ASSERT_FALSE(status.ok()) << "call " << call;
      const bool flipped = fault == Fault::kBitFlip;
      EXPECT_EQ(status.error().code, flipped ? ErrorCode::kCorrupt : ErrorCode::kStorage) << status.error().message;
    }
    EXPECT_GE(call, 8u);
  }
}

}  // namespace
}  // namespace shoal
