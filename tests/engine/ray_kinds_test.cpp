// The rays that are taken down of a picture are those that it was rendered with, each under what it was born as, in one
// order whatever the render did; and orders agree on their hits.
#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "engine/camera.h"
#include "engine/ray_kinds.h"
#include "engine/sample_order.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

constexpr float kSide = 3;           ///< of a quad: quad i is at x in [4i, 4i + 3], z in [0, 3], y = 0, facing up
constexpr float kLampHeight = 4;
const Vec3 kBulb(6, 3, 1);

/// All that there are but kAuto.
const std::vector<Order> kOrders = [] {
  std::vector<Order> orders;
  for (uint8_t i = 1; !order_name(static_cast<Order>(i)).empty(); ++i) orders.push_back(static_cast<Order>(i));
  return orders;
}();

enum Quad { kMatte, kMetalMirror, kMetalGlossy, kThinGlass };

/// A matte, a mirror, a glossy and a thin glass quad side by side over a matte floor, below a lamp of triangles and a bulb.
void save_quads(MemoryFileSystem& fs) {
  WrittenScene scene;
  const auto matte = [](double grey) {
    return nlohmann::json{{"pbrMetallicRoughness", {{"baseColorFactor", {grey, grey, grey, 1}}, {"metallicFactor", 0}}},
                          {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}};
  };
  const auto metal = [](double roughness) {
    return nlohmann::json{{"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", roughness}}}};
  };
  nlohmann::json glass = matte(1);
  glass["pbrMetallicRoughness"]["roughnessFactor"] = 0;
  glass["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", 1}};
  scene.json["extensionsUsed"] = {"KHR_materials_specular", "KHR_materials_transmission", "KHR_lights_punctual"};
  scene.json["materials"] = {matte(0.8), metal(0), metal(0.5), glass, {{"emissiveFactor", {1, 1, 1}}}};
  const auto add_quad = [&](Vec3 corner, Vec3 a, Vec3 b, uint32_t material) {
    std::vector<float> positions;
    for (const Vec3& p : {corner, corner + a, corner + a + b, corner, corner + a + b, corner + b}) {
      positions.insert(positions.end(), {p.x, p.y, p.z});
    }
    const uint32_t mesh = scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, positions)}}},
                                          {"material", material}});
    scene.add_node({{"mesh", mesh}});
  };
  for (uint32_t i = 0; i < 4; ++i) add_quad({4.0f * static_cast<float>(i), 0, 0}, {0, 0, kSide}, {kSide, 0, 0}, i);
  add_quad({-2, -1, -2}, {0, 0, 7}, {20, 0, 0}, kMatte);
  add_quad({4, kLampHeight, 0}, {kSide, 0, 0}, {0, 0, kSide}, 4);
  scene.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 50}}};
  scene.add_node({{"translation", {kBulb.x, kBulb.y, kBulb.z}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.9}, {"znear", 0.1}}}}};
  scene.add_node({{"camera", 0}, {"translation", {7, 6, 9}}, {"rotation", {-0.34202, 0, 0, 0.93969}}});  // 40 degrees down
  scene.save(fs);
}

class RayKinds : public ::testing::Test {
 protected:
  RayKinds() {
    save_quads(fs_);
    SceneBuildOptions options;
    options.threads = 1;
    built_.emplace(build_and_open(fs_, options));
    picture_.width = 100, picture_.height = 70, picture_.samples = 3;
    picture_.shading.bounces = 4;
    execution_.threads = 2;
  }

  std::vector<RecordedKind> recorded(Order order, unsigned threads, RenderCounters* counters = nullptr) {
    RayRecorder recorder(picture_.width, threads);
    RenderHooks hooks;
    hooks.recorder = &recorder;
    ExecutionOptions execution;
    execution.order = order, execution.threads = threads;
    const auto result = render(fs_, built_->scene, picture_, execution, hooks);
    EXPECT_TRUE(result.ok()) << result.error().message;
    if (result.ok() && counters != nullptr) *counters = result.value().counters;
    return recorder.take();
  }

  static bool same(const std::vector<QueryRay>& a, const std::vector<QueryRay>& b) {
    static_assert(sizeof(QueryRay) == 9 * sizeof(float));  // no padding
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(QueryRay)) == 0;
  }

  MemoryFileSystem fs_;
  std::optional<BuiltScene> built_;
  PictureOptions picture_;
  ExecutionOptions execution_;
};

TEST_F(RayKinds, OfTheCameraAreTheCamerasInTheOrderOfItsSamples) {
  const std::vector<RecordedKind> kinds = recorded(Order::kQueued, 2);
  ASSERT_FALSE(kinds.empty());
  ASSERT_EQ(kinds[0].birth, RayBirth::kCamera);
  const SampleOrder samples(picture_.width, picture_.height, picture_.samples);
  ASSERT_EQ(kinds[0].rays.size(), samples.count());
  const Camera camera(built_->scene.cameras[0], picture_.width, picture_.height);
  const Sampler sampler(picture_.shading.sampler, picture_.shading.seed, picture_.width, picture_.height, picture_.samples);
  for (uint64_t i = 0; i < samples.count(); ++i) {
    const PixelSample s = samples.at(i);
    const CameraRay ray =
        camera.ray(s.x, s.y, sampler.draw(s.y * picture_.width + s.x, s.sample, 0, Dimension::kPixel));
    ASSERT_EQ(kinds[0].rays[i].origin, ray.origin) << i;
    ASSERT_EQ(kinds[0].rays[i].direction, ray.direction) << i;
    ASSERT_EQ(kinds[0].rays[i].t_max, kRayInfinity) << i;
  }
}

TEST_F(RayKinds, AreTheSameListsWhateverTheOrderAndTheThreads) {
  const std::vector<RecordedKind> expected = recorded(Order::kDepthFirst, 1);
  EXPECT_GT(expected.size(), 15u);
  for (const Order order : kOrders) {
    for (const unsigned threads : {1u, 3u}) {
      const std::vector<RecordedKind> kinds = recorded(order, threads);
      ASSERT_EQ(kinds.size(), expected.size());
      for (size_t i = 0; i < kinds.size(); ++i) {
        EXPECT_EQ(kinds[i].birth, expected[i].birth);
        EXPECT_EQ(kinds[i].bounce, expected[i].bounce);
        EXPECT_TRUE(same(kinds[i].rays, expected[i].rays)) << order_name(order) << ", kind " << i;
      }
    }
  }
}

TEST_F(RayKinds, AreAsManyAsTheRenderTraced) {
  RenderCounters counters;
  uint64_t shadow[kCountedBounces] = {}, bounce[kCountedBounces] = {};
  for (const RecordedKind& kind : recorded(Order::kQueued, 2, &counters)) {
    const bool is_shadow = kind.birth == RayBirth::kPointShadow || kind.birth == RayBirth::kAreaShadow;
    if (kind.birth != RayBirth::kCamera) (is_shadow ? shadow : bounce)[kind.bounce] += kind.rays.size();
  }
  EXPECT_GT(shadow[1], 0u);
  for (uint32_t i = 0; i < kCountedBounces; ++i) {
    EXPECT_EQ(shadow[i], counters.rays[static_cast<size_t>(RayKind::kShadow)][i].rays_traced_count) << i;
    EXPECT_EQ(bounce[i], counters.rays[static_cast<size_t>(RayKind::kBounce)][i].rays_traced_count) << i;
  }
}

TEST_F(RayKinds, AreNamedAfterTheLobesAndLightsThatTheyComeFrom) {
  std::map<RayBirth, uint64_t> first_bounce;
  for (const RecordedKind& kind : recorded(Order::kHybrid, 1)) {
    for (const QueryRay& ray : kind.rays) {
      const Vec3 end = ray.origin + ray.direction * ray.t_max;
      if (kind.birth == RayBirth::kPointShadow) {
        ASSERT_LT(glm::length(end - kBulb), 1e-4f);
      } else if (kind.birth == RayBirth::kAreaShadow) {
        ASSERT_NEAR(end.y, kLampHeight, 1e-3f);
        ASSERT_TRUE(end.x >= 3.999f && end.x <= 7.001f && end.z >= -0.001f && end.z <= 3.001f);
      } else if (kind.bounce == 1 && std::abs(ray.origin.y) < 0.01f) {  // from one of the quads that the camera sees
        const auto quad = static_cast<uint32_t>(std::max(ray.origin.x, 0.0f) / 4);
        ++first_bounce[kind.birth];
        ASSERT_TRUE(kind.birth != RayBirth::kDiffuse || quad == kMatte);
        ASSERT_TRUE(kind.birth != RayBirth::kGlossy || quad == kMetalGlossy);
        ASSERT_TRUE(kind.birth != RayBirth::kMirror || quad == kMetalMirror || quad == kThinGlass);
        ASSERT_TRUE(kind.birth != RayBirth::kTransmission || quad == kThinGlass);
        ASSERT_EQ(ray.direction.y < 0, kind.birth == RayBirth::kTransmission);
      }
    }
  }
  for (const RayBirth birth : {RayBirth::kDiffuse, RayBirth::kGlossy, RayBirth::kMirror, RayBirth::kTransmission}) {
    EXPECT_GT(first_bounce[birth], 100u) << kRayBirthNames[static_cast<size_t>(birth)];
  }
}

TEST_F(RayKinds, AreOfWholeTilesUpToTheNumberAskedFor) {
  picture_.width = 640, picture_.height = 330, picture_.samples = 64;
  for (const uint64_t rays : {1ull, 1024ull, 5000ull, 70000ull, 1ull << 20, 1ull << 30}) {
    const PictureOptions part = part_for_kinds(picture_, rays);
    const SampleOrder samples(part.width, part.height, part.samples, part.tile_sample);
    EXPECT_LE(samples.count(), std::max<uint64_t>(rays, 1024)) << rays;
    EXPECT_GE(samples.count() * 4, std::min<uint64_t>(rays, 640ull * 330 * 64)) << rays;
    EXPECT_GE(part.samples, 1u);
  }
  EXPECT_EQ(part_for_kinds(picture_, 1ull << 30).tile_sample, 1u);
  EXPECT_EQ(part_for_kinds(picture_, 1ull << 30).samples, 64u);
}

TEST_F(RayKinds, AreOfTheSamplesThatThePictureBeginsWith) {
  const auto taken = take_kinds(fs_, built_->scene, picture_, execution_, {.rays = 2048, .births = {RayBirth::kCamera}});
  ASSERT_TRUE(taken.ok()) << taken.error().message;
  ASSERT_EQ(taken.value().kinds.size(), 1u);
  const std::vector<QueryRay>& part = taken.value().kinds[0].rays;
  const std::vector<QueryRay> whole = recorded(Order::kQueued, 1)[0].rays;
  EXPECT_EQ(part.size(), taken.value().paths_count);
  EXPECT_LE(part.size(), 2048u);
  // Of one of two samples at least, one after the other, and each is in the whole, in the same order.
  auto at = whole.begin();
  for (const QueryRay& ray : part) {
    at = std::find_if(at, whole.end(), [&](const QueryRay& w) { return w.direction == ray.direction; });
    ASSERT_NE(at, whole.end());
  }
}

TEST_F(RayKinds, HaveTheSameHitsInEveryOrderAndThoseOfTheRender) {
  RenderCounters counters;
  recorded(Order::kQueued, 1, &counters);
  const auto taken = take_kinds(fs_, built_->scene, picture_, execution_, {.rays = 1u << 20});
  ASSERT_TRUE(taken.ok()) << taken.error().message;
  std::vector<ExecutionOptions> orders;
  for (const Order order : kOrders) {
    orders.push_back(execution_);
    orders.back().order = order;
  }
  size_t calls = 0;
  const auto rows = trace_kinds(fs_, built_->scene, taken.value(), picture_.shading, orders, 2,
                                [&](size_t done, size_t of) { calls += done == calls + 1 && of == taken.value().kinds.size(); });
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows.value().size(), taken.value().kinds.size());
  EXPECT_EQ(calls, rows.value().size());
  uint64_t hits = 0;
  for (const KindRow& row : rows.value()) {
    EXPECT_TRUE(row.identical);
    ASSERT_EQ(row.orders.size(), orders.size());
    hits += row.orders[0].cold().hits_count;
    for (size_t i = 0; i < orders.size(); ++i) {
      const KindInOrder& in_order = row.orders[i];
      EXPECT_EQ(in_order.order, orders[i].order);
      EXPECT_EQ(in_order.runs.size(), 2u);
      EXPECT_EQ(in_order.cold().rays_count, row.rays_count);
      EXPECT_EQ(in_order.cold().hits_count, row.orders[0].cold().hits_count);
      EXPECT_EQ(in_order.warm().hits_count, row.orders[0].cold().hits_count);
      EXPECT_EQ(in_order.cold().treelet_loads_count, 1u);  // so small is the scene
      EXPECT_EQ(in_order.warm().treelet_loads_count, 0u);
    }
  }
  EXPECT_EQ(hits, counters.total().ray_hits_count);
}

TEST_F(RayKinds, AreRefusedBeforehandWhereTheCapHasNoRoomForThem) {
  execution_.order = Order::kQueued;
  execution_.process_bytes = 50ull << 20;
  execution_.max_memory_bytes = 200ull << 20;
  EXPECT_TRUE(check_kinds_fit(fs_, built_->scene, picture_, {&execution_, 1}, {}).ok());
  // Just enough to render, not for the lists.
  uint64_t least = 50ull << 20;
  for (;; least += 1u << 20) {
    execution_.max_memory_bytes = least;
    if (render(fs_, built_->scene, picture_, execution_).ok()) break;
  }
  execution_.max_memory_bytes += 1u << 19;
  const Status refused = check_kinds_fit(fs_, built_->scene, picture_, {&execution_, 1}, {});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kMemoryCap);
}

TEST_F(RayKinds, TakeNoMoreThanTheirShareOfASmallCap) {
  picture_.shading.bounces = 400;
  execution_.max_memory_bytes = 512ull << 20;
  const auto taken = take_kinds(fs_, built_->scene, picture_, execution_, {.rays = 1u << 30});
  ASSERT_TRUE(taken.ok()) << taken.error().message;
  EXPECT_LE(taken.value().paths_count, (64ull << 20) / RayRecorder::bytes(1, 400));
  EXPECT_GE(taken.value().paths_count, 1024u);
}

}  // namespace
}  // namespace shoal::testing
