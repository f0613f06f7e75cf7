#include "engine/cache_levels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace shoal {
namespace {

using ::testing::HasSubstr;

TEST(CacheLevels, AreReadAsTheyAreWritten) {
  const auto shapes = parse_cache_levels("48K:12,2M:16,105M:15");
  ASSERT_TRUE(shapes.ok()) << shapes.error().message;
  ASSERT_EQ(shapes.value().size(), 3u);
  EXPECT_EQ(shapes.value()[0].bytes, 48u << 10);
  EXPECT_EQ(shapes.value()[0].ways, 12u);
  EXPECT_EQ(shapes.value()[2].bytes, 105u << 20);
  EXPECT_EQ(shapes.value()[2].sets(), 114688u);
  EXPECT_EQ(cache_levels_text(shapes.value()), "48K:12,2M:16,105M:15");
  EXPECT_TRUE(parse_cache_levels("4096:1").ok());
}

TEST(CacheLevels, WhatIsNoCacheIsRefusedAndNamed) {
  for (const char* text : {"", ",", "48K", "48K:", ":12", "48K:0", "0:8", "48K:12,", "48K:x", "48Q:12", "1000:3",
                           "-1:1", "48K:12:2", "99999999999999G:16", "4K:1,4K:1,4K:1,4K:1,4K:1"}) {
    const auto shapes = parse_cache_levels(text);
    ASSERT_FALSE(shapes.ok()) << text;
    EXPECT_EQ(shapes.error().code, ErrorCode::kUsage);
    EXPECT_THAT(shapes.error().message, HasSubstr("--cache-levels '" + std::string(text) + "'"));
  }
}

class MachineLevels : public ::testing::Test {
 protected:
  void cache(int index, const std::string& type, int level, const std::string& size, int ways, int line = 64) {
    const std::filesystem::path at = folder_ / ("index" + std::to_string(index));
    std::filesystem::create_directories(at);
    std::ofstream(at / "type") << type << "\n";
    std::ofstream(at / "level") << level << "\n";
    std::ofstream(at / "size") << size << "\n";
    std::ofstream(at / "ways_of_associativity") << ways << "\n";
    std::ofstream(at / "coherency_line_size") << line << "\n";
  }
  CacheLevels levels() { return machine_cache_levels(folder_ / ""); }
  testing::TemporaryFolder folder_;
};

TEST_F(MachineLevels, AreThoseThatHoldData) {
  cache(0, "Data", 1, "48K", 12);
  cache(1, "Instruction", 1, "32K", 8);
  cache(2, "Unified", 2, "1024K", 16);
  cache(3, "Unified", 3, "32768K", 16);
  EXPECT_EQ(cache_levels_text(levels().shapes), "48K:12,1M:16,32M:16");
  EXPECT_EQ(levels().source, "this machine's");
}

TEST_F(MachineLevels, AreAssumedWhereTheMachineDoesNotSayThem) {
  EXPECT_THAT(levels().source, HasSubstr("assumed"));
  EXPECT_EQ(levels().shapes.size(), 3u);
  cache(0, "Data", 1, "48K", 12, 128);  // other lines than the model's
  EXPECT_THAT(levels().source, HasSubstr("assumed"));
  cache(0, "Data", 1, "48K", 0);  // as some virtual machines have it
  EXPECT_THAT(levels().source, HasSubstr("assumed"));
  cache(0, "Unified", 2, "1024K", 16);
  EXPECT_THAT(levels().source, HasSubstr("assumed")) << "no first level";
}

TEST(CacheLevels, OfThisMachineCanBeModelled) {
  const CacheLevels levels = machine_cache_levels();
  EXPECT_TRUE((CacheModel::Options{.levels = levels.shapes}.check().ok()));
  EXPECT_NE(levels.source, "");
}

}  // namespace
}  // namespace shoal
