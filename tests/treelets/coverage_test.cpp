// Coverage decided in traversal: filtering and wrapping of alpha, thresholds, and that no order can change it.
#include "treelets/coverage_test.h"

#include <gtest/gtest.h>

#include "tests/support/hand_made_scene.h"
#include "treelets/coverage.h"

namespace shoal::testing {
namespace {

CoverageRecord record_of(CoverageMode mode, uint32_t width, uint32_t height) {
  CoverageRecord record{};
  std::fill(record.vertex_alpha, record.vertex_alpha + 3, 1.0f);
  record.factor = 1, record.cutoff = 0.5f, record.mode = static_cast<uint8_t>(mode);
  record.crop_width = width, record.crop_height = height;
  return record;
}

/// Alpha at texel coordinates (u, v): the triangle's corners all stand there.
float alpha_at(CoverageRecord record, const std::vector<uint8_t>& texels, float u, float v) {
  for (int k = 0; k < 3; ++k) record.uv[2 * k] = u, record.uv[2 * k + 1] = v;
  return coverage_alpha(record, texels.data(), 0.25f, 0.25f);
}

TEST(Coverage, FiltersBilinearlyBetweenTexelCentres) {
  const std::vector<uint8_t> texels{0, 255, 51, 102};
  const CoverageRecord record = record_of(CoverageMode::kMask, 2, 2);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 0.5f, 0.5f), 0);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 1.5f, 0.5f), 1);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 0.5f, 1.5f), 0.2f);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 1, 0.5f), 0.5f);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 1, 1), 0.4f);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, -9, -9), 0) << "a crop is clamped to";
}

TEST(Coverage, NearestTakesTheTexelThatHoldsThePoint) {
  const std::vector<uint8_t> texels{0, 255, 51, 102};
  CoverageRecord record = record_of(CoverageMode::kMask, 2, 2);
  record.nearest = 1;
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 0.99f, 0.99f), 0);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 1.01f, 0.99f), 1);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, 1.01f, 1.01f), 0.4f);
}

TEST(Coverage, CropsStandAtTheirPlaceInTheUnwrappedTexture) {
  const std::vector<uint8_t> texels{0, 0, 0, 255};
  CoverageRecord record = record_of(CoverageMode::kMask, 2, 2);
  record.crop_x = -7, record.crop_y = 100;
  EXPECT_FLOAT_EQ(alpha_at(record, texels, -5.5f, 101.5f), 1);
  EXPECT_FLOAT_EQ(alpha_at(record, texels, -6.5f, 101.5f), 0);
}

TEST(Coverage, WholeLevelsWrapAsTheSamplerSays) {
  const std::vector<uint8_t> texels{0, 51, 102, 255};
  CoverageRecord record = record_of(CoverageMode::kMask, 4, 1);
  record.whole_level = 1, record.nearest = 1;
  const auto row = [&](WrapMode mode) {
    record.wrap_u = static_cast<uint8_t>(mode);
    std::vector<int> alphas;
    for (int x = -5; x < 9; ++x) {
      alphas.push_back(
          static_cast<int>(std::lround(255 * alpha_at(record, texels, static_cast<float>(x) + 0.5f, 0.5f))));
    }
    return alphas;
  };
  EXPECT_EQ(row(WrapMode::kRepeat), (std::vector<int>{255, 0, 51, 102, 255, 0, 51, 102, 255, 0, 51, 102, 255, 0}));
  EXPECT_EQ(row(WrapMode::kMirroredRepeat),
            (std::vector<int>{255, 255, 102, 51, 0, 0, 51, 102, 255, 255, 102, 51, 0, 0}));
  EXPECT_EQ(row(WrapMode::kClampToEdge),
            (std::vector<int>{0, 0, 0, 0, 0, 0, 51, 102, 255, 255, 255, 255, 255, 255}));
  EXPECT_GE(alpha_at(record, texels, 1e12f, -1e12f), 0) << "far outside";
}

TEST(Coverage, MultipliesFactorAndVertexAlpha) {
  CoverageRecord record = record_of(CoverageMode::kMask, 0, 0);
  record.factor = 0.5f;
  record.vertex_alpha[0] = 1, record.vertex_alpha[1] = 0, record.vertex_alpha[2] = 0.5f;
  EXPECT_FLOAT_EQ(coverage_alpha(record, nullptr, 0, 0), 0.5f);
  EXPECT_FLOAT_EQ(coverage_alpha(record, nullptr, 1, 0), 0);
  EXPECT_FLOAT_EQ(coverage_alpha(record, nullptr, 0.25f, 0.5f), 0.25f);
}

TEST(Coverage, MaskKeepsAlphaAtTheCutoff) {
  CoverageRecord record = record_of(CoverageMode::kMask, 0, 0);
  record.factor = 0.5f;
  EXPECT_TRUE(is_covered(record, nullptr, {1, 0, 0}, 1, 2, 3));
  record.cutoff = std::nextafter(0.5f, 1.0f);
  EXPECT_FALSE(is_covered(record, nullptr, {1, 0, 0}, 1, 2, 3));
}

TEST(Coverage, BlendKeepsTheShareThatAlphaSays) {
  CoverageRecord record = record_of(CoverageMode::kBlend, 0, 0);
  for (const float alpha : {0.0f, 0.1f, 0.5f, 0.9f, 1.0f}) {
    record.factor = alpha;
    for (const int varied : {0, 1, 2}) {  // seed, instance, primitive: each alone must vary the threshold
      int kept = 0;
      constexpr int kCount = 20000;
      for (uint32_t i = 0; i < kCount; ++i) {
        kept +=
            is_covered(record, nullptr, {1, 0, 0}, varied == 0 ? i : 5, varied == 1 ? i : 6, varied == 2 ? i : 7);
      }
      EXPECT_NEAR(kept / double{kCount}, alpha, 4 * std::sqrt(alpha * (1 - alpha) / kCount)) << varied;
    }
  }
}

TEST(Coverage, TracesAsBruteForceWhateverTheOrderOfTriangles) {
  std::mt19937 random(1);
  const auto soup = random_soup(random, 600, 0.5f);
  std::vector<CoverageRecord> records{record_of(CoverageMode::kMask, 8, 8), record_of(CoverageMode::kBlend, 8, 8)};
  for (CoverageRecord& record : records) {
    for (float& x : record.uv) x = 4 + random_vector(random, 4).x;
  }
  std::vector<uint8_t> texels(64);
  for (uint8_t& texel : texels) texel = static_cast<uint8_t>(random());
  const auto which = [](uint32_t primitive) { return primitive % 3 == 2 ? kNoIndex : primitive % 3; };
  const auto pack = [&](bool reversed, size_t leaf_size, NodeRef& root) {
    auto packed = soup;
    if (reversed) std::reverse(packed.begin(), packed.end());
    PagePacker packer(leaf_size);
    packer.set_coverage(records, texels, which);
    root = packer.add(packed);
    return AlignedPage(packer.finish());
  };
  NodeRef roots[2];
  const AlignedPage pages[2] = {pack(false, 3, roots[0]), pack(true, 8, roots[1])};
  const Instance instance = make_instance({0, {}}, 1, bounds_of(std::span(soup)));
  size_t skipped = 0;
  for (int i = 0; i < 3000; ++i) {
    Ray start = make_ray(random_vector(random), random_vector(random), kRayInfinity, i % 3 == 0);
    start.instance = 0, start.alpha_seed = static_cast<uint32_t>(random());
    Ray expected = start;
    const RaySpace space = to_object_space(start, instance);
    for (const TestTriangle& t : soup) {
      TriangleHit hit;
      if (!intersect_triangle(space, t.p[0], t.p[1], t.p[2], expected.t, hit)) continue;
      const uint32_t record = which(t.primitive);
      if (record != kNoIndex &&
          !is_covered(records[record], texels.data(), hit, start.alpha_seed, 0, t.primitive)) {
        ++skipped;
        continue;
      }
      if (!comes_before(expected, hit.t, 0, t.primitive)) continue;
      expected.hit = {0, t.primitive, 0, 0}, expected.t = hit.t;
    }
    for (int k = 0; k < 2; ++k) {
      Ray ray = start;
      TraceCounters counters;
      trace_treelet(pages[k].bytes(), {0, roots[k]}, instance, ray, counters);
      ASSERT_EQ(ray.hit.valid(), expected.hit.valid()) << "ray " << i;
      if (ray.any_hit() || !ray.hit.valid()) continue;
      ASSERT_EQ(ray.hit.primitive, expected.hit.primitive) << "ray " << i;
      ASSERT_EQ(ray.t, expected.t) << "ray " << i;
    }
  }
  EXPECT_GT(skipped, 1000u);
}

}  // namespace
}  // namespace shoal::testing
