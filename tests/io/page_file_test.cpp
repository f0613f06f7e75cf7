#include "io/page_file.h"

#include <gtest/gtest.h>

#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

TEST(PageFile, GivesBackEveryPageAndTable) {
  MemoryFileSystem fs;
  const std::vector<Bytes> pages = {pattern_bytes(1, 1, 0), pattern_bytes(70000, 2, 64), pattern_bytes(8192, 3, 0),
                                    pattern_bytes(300001, 4, 0), pattern_bytes(300001, 5, 1000)};
  const Bytes table = pattern_bytes(2 * kTablePageBytes + 17, 6, 5000);
  const Bytes exact = pattern_bytes(kTablePageBytes, 7, 300);
  {
    auto writer = PageFileWriter::create(fs, "dir/a.shoal");
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer.value().append_table(1, table).ok());
    for (size_t i = 0; i < pages.size(); ++i) {
      auto id = writer.value().append(i % 2 ? PageKind::kTreelet : PageKind::kTexture, pages[i]);
      ASSERT_TRUE(id.ok());
      EXPECT_EQ(id.value(), 3 + i);
    }
    ASSERT_TRUE(writer.value().append_table(2, {}).ok());
    ASSERT_TRUE(writer.value().append_table(3, exact).ok());
    EXPECT_FALSE(fs.exists("dir/a.shoal"));
    ASSERT_TRUE(writer.value().finish().ok());
  }
  EXPECT_EQ(fs.names(), std::vector<std::string>{"dir/a.shoal"});
  auto file = PageFile::open(fs, "dir/a.shoal", ReadMode::kDirect);
  ASSERT_TRUE(file.ok()) << file.error().message;
  const PageFile& f = *file.value();
  ASSERT_TRUE(f.verify().ok()) << f.verify().error().message;
  ASSERT_EQ(f.page_count(), 3 + pages.size() + 2);
  for (size_t i = 0; i < pages.size(); ++i) {
    const auto id = static_cast<PageId>(3 + i);
    Bytes out(f.record(id).raw_bytes);
    uint64_t read_bytes = 0;
    ASSERT_TRUE(f.read_page(id, out, &read_bytes).ok());
    EXPECT_EQ(out, pages[i]);
    EXPECT_EQ(read_bytes, (f.record(id).stored_bytes + 4095) / 4096 * 4096u);
  }
  EXPECT_EQ(f.record(4).codec, PageCodec::kLz4);
  EXPECT_EQ(f.record(5).codec, PageCodec::kRaw);
  EXPECT_EQ(f.read_table(1, 1u << 30).value(), table);
  EXPECT_EQ(f.read_table(3, 1u << 30).value(), exact);
  EXPECT_TRUE(f.has_table(2));
  EXPECT_TRUE(f.read_table(2, 0).value().empty());
  EXPECT_FALSE(f.has_table(4));
  EXPECT_EQ(f.read_table(4, 1).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(f.read_table(1, table.size() - 1).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace shoal
