// What is not a number never reaches the film: it is counted by its term, its first place is known and the same in every
// order, and the render says so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/render_report.h"
#include "tests/numerics/built_soup.h"
#include "tests/support/shading_scene.h"

namespace shoal::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TriangleSoup floor_soup() {
  TriangleSoup soup;
  add_rectangle(soup, {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, 0);
  return soup;
}

class FloorUnderSky : public ShadingScene {
 public:
  explicit FloorUnderSky(float sky) : ShadingScene(floor_soup(), {matte(Vec3(0.5f))}) {
    ShadingOptions asked;
    asked.bounces = 2;
    asked.environment.kind = EnvironmentOptions::Kind::kConstant;
    asked.environment.radiance = Vec3(sky);
    prepare(asked);
  }
};

TEST(InvalidSamples, TheSkyIsCountedAsSuchAndLeavesTheRestAlone) {
  FloorUnderSky s(kInfinity);
  for (uint32_t i = 0; i < 20; ++i) EXPECT_EQ(s.radiance({0, 1, 0}, {0, -1, 0.1f}, 3, i), Vec3(0));
  const InvalidSamples& invalid = s.counters.invalid;
  EXPECT_EQ(invalid.total(), 20u);
  EXPECT_EQ(invalid.of(InvalidTerm::kEnvironment), 20u);
  EXPECT_EQ(invalid.first, (InvalidPlace{3, 0, 1, InvalidTerm::kEnvironment}));
}

TEST(InvalidSamples, APathWhoseThroughputOverflowsEndsAndIsCounted) {
  FloorUnderSky s(1);
  PathState path;
  path.pixel = 9, path.sample = 2;
  path.origin = {0, 1, 0}, path.direction = {0, -1, 0.1f};
  path.throughput = Vec3(kInfinity);
  const Ray ray = s.trace(path.origin, path.direction, kRayInfinity, false);
  path.hit = ray.hit, path.t = ray.t;
  ShadeResult result;
  ASSERT_TRUE(s.shader->shade_hit(path, s.geometry[0].bytes(), s.attributes[0].bytes(), result, s.counters,
                                  s.cache_counters).ok());
  EXPECT_FALSE(result.has_bounce);
  EXPECT_EQ(s.counters.invalid.of(InvalidTerm::kBounce), 1u);
  EXPECT_EQ(s.counters.invalid.first, (InvalidPlace{9, 2, 0, InvalidTerm::kBounce}));
}

/// A picture of triangles whose vertex colours overflow between the corners where the factor is zero.
void save_overflowing_colours(MemoryFileSystem& fs) {
  WrittenScene scene;
  const float most = 3e38f;
  const nlohmann::json attributes = {
      {"POSITION", scene.add_floats(3, {-1, -1, 0, 1, -1, 0, 1, 1, 0})},
      {"COLOR_0", scene.add_floats(3, {-most, -most, 0.5f, most, most, 0.5f, most, most, 0.5f})}};
  scene.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, 1, 1, 1}}}}}};
  const uint32_t mesh = scene.add_mesh({{"attributes", attributes}, {"material", 0}});
  scene.add_node({{"mesh", mesh}});
  scene.json["cameras"] = {{{"type", "orthographic"},
                            {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0}, {"zfar", 10}}}}};
  scene.add_node({{"camera", 0}, {"translation", {0, 0, 2}}});
  scene.save(fs);
}

TEST(InvalidSamples, ARenderCountsThemAlikeInEveryOrderAndSaysSo) {
  MemoryFileSystem fs;
  save_overflowing_colours(fs);
  const BuiltScene built = build_and_open(fs);
  PictureOptions picture;
  picture.width = picture.height = 16, picture.samples = 2;
  picture.shading.sampler = SamplerKind::kIndependent;  // whose first sample at (15, 0) hits the overflow
  picture.aovs = parse_aovs("all").value();
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  std::vector<uint64_t> counts;
  std::vector<float> first;
  for (const Order order : {Order::kDepthFirst, Order::kQueued, Order::kSorted, Order::kHybrid}) {
    ExecutionOptions execution;
    execution.order = order, execution.threads = 2;
    const auto result = render(fs, built.scene, picture, execution);
    ASSERT_TRUE(result.ok()) << result.error().message;
    const RenderCounters& c = result.value().counters;
    counts.push_back(c.invalid_samples_count);
    EXPECT_GT(c.invalid_surface_count, 100u);
    const std::vector<std::string> warnings = number_warnings(c, picture.width);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_THAT(warnings[0], HasSubstr("contributions were not finite and were dropped (surface "));
    EXPECT_THAT(warnings[0], HasSubstr("the first: surface, pixel (15, 0), sample 0, vertex 0"));
    const auto json = nlohmann::json::parse(stats_json(result.value(), built.scene, picture, execution));
    EXPECT_EQ(json["first_invalid"]["term"], "surface");
    EXPECT_EQ(json["first_invalid"]["x"], 15);
    EXPECT_EQ(json["counters"]["totals"]["invalid_surface_count"], c.invalid_surface_count);
    for (const float value : result.value().rgba) ASSERT_TRUE(std::isfinite(value));
    for (const ExrChannel& layer : result.value().layers) {
      for (const float value : layer.values) ASSERT_FALSE(std::isnan(value)) << layer.name;
    }
    if (first.empty()) first = result.value().rgba;
    EXPECT_EQ(first, result.value().rgba);
  }
  EXPECT_THAT(counts, ElementsAre(counts[0], counts[0], counts[0], counts[0]));
}

TEST(InvalidSamples, AFilmThatClampsSaysSo) {
  RenderCounters counters;
  EXPECT_TRUE(number_warnings(counters, 10).empty());
  counters.film_saturated_count = 3;
  EXPECT_THAT(number_warnings(counters, 10), ElementsAre(HasSubstr("3 samples were brighter than 1.1e+12")));
}

}  // namespace
}  // namespace shoal::testing
