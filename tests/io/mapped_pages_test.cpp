#include "io/mapped_pages.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <unistd.h>

#include "io/page_file.h"

namespace shoal {
namespace {

class MappedPagesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("shoal-mapped-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    auto writer = PageFileWriter::create(fs_, scene());
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer.value().append_table(7, bytes(5000, 1)).ok());
    for (const uint32_t size : {1u, 4095u, 4096u - 64, 4096u - 63, 100'000u}) {
      const bool odd = size % 2 != 0;
      ASSERT_TRUE(writer.value().append(odd ? PageKind::kTreelet : PageKind::kAttributes, bytes(size, size)).ok());
    }
    ASSERT_TRUE(writer.value().finish().ok());
    auto file = PageFile::open(fs_, scene(), ReadMode::kBuffered);
    ASSERT_TRUE(file.ok());
    file_ = std::move(file).value();
  }
  void TearDown() override {
    std::error_code code;
    std::filesystem::remove_all(folder_, code);
  }

  static std::vector<std::byte> bytes(size_t count, uint32_t seed) {
    std::vector<std::byte> values(count);
    for (std::byte& value : values) value = static_cast<std::byte>((seed = seed * 1664525 + 1013904223) >> 24 | 1);
    return values;
  }
  std::string scene() const { return folder_ / "scene.shoal"; }
  std::string pages() const { return folder_ / "scene.pages"; }

  FileSystem& fs_ = posix_file_system();
  std::filesystem::path folder_;
  std::unique_ptr<PageFile> file_;
};

TEST_F(MappedPagesTest, HoldEveryPageDecodedAndAlignedWithZerosAfterIt) {
  ASSERT_TRUE(MappedPages::write(fs_, *file_, {}, pages()).ok());
  EXPECT_EQ(std::filesystem::file_size(pages()), MappedPages::file_bytes(*file_));
  const auto mapped = MappedPages::open(*file_, pages(), MapAdvice::kRandom);
  ASSERT_TRUE(mapped.ok()) << mapped.error().message;
  for (const PageRecord& record : file_->records()) {
    if (record.kind == PageKind::kTable) continue;
    const std::span<const std::byte> found = mapped.value()->bytes(record.id);
    ASSERT_EQ(found.size(), record.raw_bytes);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(found.data()) % kPageAlignment, 0u);
    const std::vector<std::byte> expected = bytes(record.raw_bytes, record.raw_bytes);
    EXPECT_EQ(std::memcmp(found.data(), expected.data(), expected.size()), 0) << "page " << record.id;
    for (size_t i = 0; i < 64; ++i) ASSERT_EQ(found.data()[found.size() + i], std::byte{0});
  }
}

TEST_F(MappedPagesTest, ServeThePinsOfAPageCacheWithoutReading) {
  ASSERT_TRUE(MappedPages::write(fs_, *file_, {}, pages()).ok());
  const auto mapped = MappedPages::open(*file_, pages(), MapAdvice::kNormal);
  ASSERT_TRUE(mapped.ok());
  PageCache cache(*file_, 4096);
  cache.serve_from(mapped.value().get());
  CacheCounters counters;
  for (int round = 0; round < 2; ++round) {
    for (PageId page = 2; page < file_->page_count(); ++page) {
      EXPECT_TRUE(cache.resident(page));
      const auto pin = cache.pin(page, counters);
      ASSERT_TRUE(pin.ok());
      EXPECT_EQ(pin.value().bytes().data(), mapped.value()->bytes(page).data());
      EXPECT_EQ(pin.value().bytes().size(), file_->record(page).raw_bytes);
    }
  }
  EXPECT_EQ(counters.page_hits_count, counters.page_requests_count);
  EXPECT_EQ(counters.disk_read_bytes, 0u);
  EXPECT_EQ(cache.resident_bytes(), 0u);
}

TEST_F(MappedPagesTest, RefuseAFileOfAnotherSizeAndPagesThatFailTheirCheck) {
  const auto missing = MappedPages::open(*file_, pages(), MapAdvice::kNormal);
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInput);
  std::ofstream(pages()) << "short";
  const auto other = MappedPages::open(*file_, pages(), MapAdvice::kNormal);
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().code, ErrorCode::kInput);
  const auto refuse = [](const PageRecord&, std::span<const std::byte>) {
    return Status(Error{ErrorCode::kCorrupt, "no"});
  };
  const std::string refused = folder_ / "refused.pages";
  EXPECT_FALSE(MappedPages::write(fs_, *file_, refuse, refused).ok());
  EXPECT_FALSE(std::filesystem::exists(refused));
}

}  // namespace
}  // namespace shoal
