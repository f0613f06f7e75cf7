#include "tests/support/paged_file.h"

#include <gtest/gtest.h>

namespace shoal {

std::vector<std::byte> pattern_bytes(size_t size, uint32_t seed, uint32_t period) {
  std::vector<std::byte> bytes(size);
  uint32_t x = seed * 2654435761u + 1;
  for (size_t i = 0; i < size; ++i) {
    x = x * 1664525u + 1013904223u;
    bytes[i] = period > 0 && i >= period ? bytes[i - period] : static_cast<std::byte>(x >> 24);
  }
  return bytes;
}

std::vector<std::byte> page_bytes(PageId id, uint32_t bytes) { return pattern_bytes(bytes, id, id % 2 ? 0 : 100); }

std::unique_ptr<PageFile> write_pages(FileSystem& fs, const std::string& path, const std::vector<PageSpec>& pages) {
  auto writer = PageFileWriter::create(fs, path);
  EXPECT_TRUE(writer.ok());
  for (PageId id = 0; id < pages.size(); ++id) {
    const auto written = writer.value().append(pages[id].kind, page_bytes(id, pages[id].bytes));
    EXPECT_TRUE(written.ok() && written.value() == id);
  }
  EXPECT_TRUE(writer.value().finish().ok());
  auto file = PageFile::open(fs, path, ReadMode::kBuffered);
  EXPECT_TRUE(file.ok()) << file.error().message;
  return std::move(file).value();
}

}  // namespace shoal
