// Texture tiles page like geometry: under one budget, read again after they were evicted, and never seen in the picture.
#include <gtest/gtest.h>

#include <cstring>

#include "engine/render.h"
#include "io/page_cache.h"
#include "tests/engine/built_scene.h"
#include "tests/support/textured_quads.h"

namespace shoal::testing {
namespace {

TEST(TexturePaging, GivesTheSameBitsWhenTilesDoNotFit) {
  MemoryFileSystem fs;
  textured_quads(fs, 2, 1024).save(fs);
  const BuiltScene built = build_and_open(fs);
  constexpr uint64_t finest = 2 * (1024 / kTextureTileTexels) * (1024 / kTextureTileTexels);
  uint64_t tiles = 0;
  for (const PageRecord& record : built.scene.file->records()) tiles += record.kind == PageKind::kTexture ? 1 : 0;
  PictureOptions picture;
  picture.width = 128, picture.height = 64, picture.samples = 2;
  picture.shading.texture_filter = TextureFilter::kBilinear;  // every tile is wanted
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};

  std::vector<float> expected;
  for (const Order order : {Order::kQueued, Order::kDepthFirst, Order::kSorted}) {
    for (const bool room : {true, false}) {
      ExecutionOptions execution;
      execution.order = order;
      execution.threads = 2;
      // The least holds a few texture tiles a thread, of hundreds.
      if (!room) execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*built.scene.file, 2);
      const auto result = render(fs, built.scene, picture, execution);
      ASSERT_TRUE(result.ok()) << result.error().message;
      const RenderCounters& counters = result.value().counters;
      if (room) {
        EXPECT_LE(counters.texture_loads_count, tiles);
        EXPECT_EQ(counters.page_evictions_count, 0u);
      } else {
        // Tiles are read again; less often where paths that come by the same places follow each other.
        EXPECT_GT(counters.texture_loads_count, finest + finest / 16);
        EXPECT_GT(counters.page_evictions_count, finest);
        EXPECT_LT(result.value().plan.cache_bytes, result.value().plan.texture_page_bytes / 25);
      }
      if (expected.empty()) expected = result.value().rgba;
      ASSERT_EQ(result.value().rgba.size(), expected.size());
      EXPECT_EQ(std::memcmp(result.value().rgba.data(), expected.data(), expected.size() * sizeof(float)), 0);
    }
  }
  const auto [least, most] = std::minmax_element(expected.begin(), expected.end());
  EXPECT_LT(*least, *most) << "the noise is in the picture";
}

}  // namespace
}  // namespace shoal::testing
