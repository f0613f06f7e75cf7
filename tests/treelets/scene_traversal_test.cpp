// Packets, packets that are put together anew, and streams (treelets/scene_traversal.h), and the inner loops in
// lock-step: whatever the rays, the answers of single rays, which trace_brute_force_test compares with testing
// every triangle.
#include <gtest/gtest.h>

#include <numeric>

#include "tests/numerics/every_kernel.h"
#include "tests/support/awkward_rays.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

struct Fixture {
  explicit Fixture(TestScene made) : scene(std::move(made)), tree(scene.nodes, scene.entries, scene.instances) {}
  TestScene scene;
  TopTree tree;
};

std::vector<Ray> one_by_one(const Fixture& f, std::vector<Ray> rays) {
  for (Ray& ray : rays) {
    trace_scene(f.tree, f.scene.pages, ray, trace_treelet);
    if (ray.any_hit()) ray.cursor = ray.instance = kNoIndex, ray.more = 0;
  }
  return rays;
}

/// trace_every_way(), and these ways on every instruction set too. Returns the rays at their ends.
std::vector<Ray> trace_really_every_way(const TestScene& scene, const std::vector<Ray>& rays,
                                        TriangleTest test = TriangleTest::kWatertight) {
  const std::vector<Ray> expected = trace_every_way(scene, rays, test);
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  TraceCounters counters;
  on_every_instruction_set([&](const char* target) {
    for (const TraversalWay& way : kTraversalWays) {
      expect_same_ends(target, way.name, expected, trace_by(way, tree, scene, rays, counters, test));
    }
  });
  return expected;
}

/// From one place, at points of a square: all signs alike, all enter the same nodes.
std::vector<Ray> camera_rays(size_t count, bool any_hit = false) {
  std::vector<Ray> rays;
  for (size_t i = 0; i < count; ++i) {
    const float u = 0.3f + 0.0004f * static_cast<float>(i % 256),
                v = 0.2f + 0.0004f * static_cast<float>(i / 256 % 256);
    rays.push_back(make_ray({-3, -3.1f, 4}, {u + 3, v + 3.1f, -4}, any_hit ? 1.0f : kRayInfinity, any_hit));
  }
  return rays;
}

TEST(SceneTraversal, GivesTheAnswersOfSingleRaysWhateverTheSizeOfThePacket) {
  std::mt19937 random(21);
  const auto soup = random_soup(random, 1500, 0.15f);
  const Fixture f(make_scene({soup}, {{0, {}}}, {100, 5}));
  const std::vector<Ray> all = awkward_rays(random, soup, 2500);
  for (const size_t count : {1u, 2u, 15u, 16u, 17u, 31u, 255u, 257u, 2048u, 2049u, 2500u}) {
    const std::vector<Ray> rays(all.begin(), all.begin() + static_cast<ptrdiff_t>(count));
    const std::vector<Ray> expected = one_by_one(f, rays);
    for (const TraversalWay& way : kTraversalWays) {
      TraceCounters counters;
      expect_same_ends("", way.name, expected, trace_by(way, f.tree, f.scene, rays, counters));
    }
  }
}

TEST(SceneTraversal, TakesRaysOfEverySignZerosAndStartsInsideBoxes) {
  std::mt19937 random(22);
  const auto mesh = closed_mesh(20, 40, 0.2f);
  const Fixture f(build_scene({mesh}, {{0, {}}}, 8u << 10));
  std::vector<Ray> rays;
  for (int i = 0; i < 27 * 40; ++i) {  // each component negative, zero of either sign or positive, from inside
    const float signs[4] = {-1, 0.0f, -0.0f, 1};
    Vec3 direction(signs[random() % 4], signs[random() % 4], signs[random() % 4]);
    if (direction == Vec3(0)) direction.x = 1;
    rays.push_back(make_ray(random_vector(random, 0.5f), direction, i % 3 == 0 ? 0.7f : kRayInfinity, i % 4 == 0));
  }
  EXPECT_GT(std::count_if(rays.begin(), rays.end(), [](const Ray& r) { return r.any_hit(); }), 200);
  trace_really_every_way(f.scene, rays);
}

TEST(SceneTraversal, TakesRaysUnderInstancesByEveryTriangleTest) {
  std::mt19937 random(23);
  const auto soup = random_soup(random, 300, 0.3f);
  const auto mesh = closed_mesh(10, 16, 0.2f, 300);
  std::vector<Placement> placements{{0, {}}};
  for (int i = 0; i < 20; ++i) {  // overlapping, mirrored, one flat and some far away
    Placement p;
    p.object = random() % 2;
    p.object_to_world = {random_vector(random), random_vector(random), random_vector(random, i == 3 ? 0.01f : 1.0f),
                         random_vector(random, i % 5 == 0 ? 50.0f : 1.0f)};
    placements.push_back(p);
  }
  const TestScene scene = make_scene({soup, mesh}, placements, {50, 4});
  std::vector<Ray> rays = awkward_rays(random, soup, 600);
  const std::vector<Ray> alike = camera_rays(400);
  rays.insert(rays.end(), alike.begin(), alike.end());
  for (const TriangleTest test : {TriangleTest::kWatertight, TriangleTest::kFast, TriangleTest::kDouble}) {
    trace_really_every_way(scene, rays, test);
  }
}

/// Half of everything is there.
class HalfThere final : public CoverageSource {
 public:
  MaterialCoverage coverage(uint32_t) const override {
    MaterialCoverage half;
    half.mode = CoverageMode::kBlend, half.factor = 0.5f;
    return half;
  }
  uint32_t level_count(uint32_t) const override { return 0; }
  void level_size(uint32_t, uint32_t, uint32_t*, uint32_t*) const override {}
  Status read_alpha(uint32_t, uint32_t, uint32_t, uint32_t, std::span<uint8_t>) const override { return {}; }
};

TEST(SceneTraversal, LetsRaysThroughWhatIsNotThere) {
  std::mt19937 random(28);
  const auto soup = random_soup(random, 1000, 0.2f);
  const HalfThere half;
  std::vector<Ray> rays = awkward_rays(random, soup, 1000);
  const std::vector<Ray> alike = camera_rays(300, true);
  rays.insert(rays.end(), alike.begin(), alike.end());
  Placement turned;
  turned.object_to_world = {{0.3f, 0.4f, 0}, {-0.4f, 0.3f, 0.1f}, {0, 0, -0.5f}, {0.5f, -0.2f, 0.1f}};
  for (const std::vector<Placement>& placements : {std::vector<Placement>{{0, {}}}, {{0, {}}, turned}}) {
    const TestScene scene = build_scene({soup}, placements, 8u << 10, 0, &half);
    const std::vector<Ray> found = trace_really_every_way(scene, rays);
    size_t differ = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      Ray all = rays[i];
      brute_force(scene, all);
      differ += all.hit.valid() != found[i].hit.valid() || (!all.any_hit() && all.t != found[i].t);
    }
    EXPECT_GT(differ, 200u) << "coverage took part";
  }
}

TEST(SceneTraversal, LosesNoRayWhateverTheStreamSays) {
  std::mt19937 random(24);
  const auto soup = random_soup(random, 1000, 0.1f);
  const Fixture f(make_scene({soup}, {{0, {}}}, {200, 4}));
  const std::vector<Ray> rays = awkward_rays(random, soup, 6000);
  const std::vector<Ray> expected = one_by_one(f, rays);
  for (const size_t most_out : {size_t{1}, size_t{40}, size_t{1000}, SIZE_MAX}) {
    for (const bool hesitates : {false, true}) {
      for (const TraversalWay& way : kTraversalWays) {
        std::vector<Ray> found = rays;
        RayListStream stream(found, f.scene, most_out, hesitates);
        TraceCounters counters;
        const auto traversal = way.make(f.tree, stream.table.data(), TriangleTest::kWatertight);
        for (int call = 0; call < 20000 && stream.done_count < rays.size(); ++call)
          traversal->trace(stream, counters);
        ASSERT_EQ(stream.done_count, rays.size()) << way.name;
        expect_same_ends("", way.name, expected, found);
      }
    }
  }
}

TEST(SceneTraversal, AnEmptySceneIsMissedAndPagesThatCannotBeHadAreGoneAround) {
  class NoPages final : public RayStream {
   public:
    explicit NoPages(std::vector<Ray>& rays) : rays_(rays) {}
    Ray* next() override { return next_ < rays_.size() ? &rays_[next_++] : nullptr; }
    void done(Ray&, const RayWork&) override { ++done_count; }
    const std::byte* bring(TreeletId) override { return nullptr; }
    size_t done_count = 0;

   private:
    std::vector<Ray>& rays_;
    size_t next_ = 0;
  };
  std::mt19937 random(25);
  const auto soup = random_soup(random, 500, 0.1f);
  const Fixture empty(make_scene({}, {})), full(make_scene({soup}, {{0, {}}}, {50, 4}));
  const TopTree none;
  for (const TopTree* tree : {&none, &empty.tree, &full.tree}) {
    const std::vector<const std::byte*> table(full.scene.pages.size(), nullptr);
    for (const TraversalWay& way : kTraversalWays) {
      std::vector<Ray> rays = awkward_rays(random, soup, 500);
      NoPages stream(rays);
      TraceCounters counters;
      way.make(*tree, table.data(), TriangleTest::kWatertight)->trace(stream, counters);
      EXPECT_EQ(stream.done_count, rays.size());
      for (const Ray& ray : rays) EXPECT_FALSE(ray.hit.valid()) << way.name;
    }
  }
}

/// Everywhere at once: no two rays alike.
std::vector<Ray> scattered_rays(std::mt19937& random, size_t count) {
  std::vector<Ray> rays;
  while (rays.size() < count) rays.push_back(make_ray(random_vector(random), random_vector(random)));
  return rays;
}

double lane_share(const TraceCounters& counters) {
  return static_cast<double>(counters.simd_active_lanes_count) / static_cast<double>(counters.simd_lanes_count);
}

TEST(SceneTraversal, LanesTellRaysThatAgreeFromRaysThatDoNot) {
  std::mt19937 random(26);
  const Fixture f(build_scene({closed_mesh(60, 120, 0.2f)}, {{0, {}}}, 8u << 10));
  TraceCounters alike[std::size(kTraversalWays)], scattered[std::size(kTraversalWays)];
  const std::vector<Ray> camera = camera_rays(4096), others = scattered_rays(random, 4096);
  for (size_t i = 0; i < std::size(kTraversalWays); ++i) {
    trace_by(kTraversalWays[i], f.tree, f.scene, camera, alike[i]);
    trace_by(kTraversalWays[i], f.tree, f.scene, others, scattered[i]);
    EXPECT_GT(lane_share(alike[i]), 0.0) << kTraversalWays[i].name;
  }
  const size_t packets = 1, reordered = 3, streams = 4;
  EXPECT_GT(lane_share(alike[packets]), 2 * lane_share(scattered[packets]));
  EXPECT_GT(lane_share(scattered[reordered]), 1.2 * lane_share(scattered[packets]))
      << "what putting them together is for";
  EXPECT_NEAR(lane_share(alike[streams]), lane_share(scattered[streams]), 0.15) << "lanes are boxes, not rays";
}

TEST(InnerLoops, FindTheHitsOfTheMoreNumerousAndLeaveLanesIdle) {
  std::mt19937 random(27);
  const auto soup = random_soup(random, 1500, 0.15f);
  const Fixture f(make_scene({soup}, {{0, {}}}, {5000, 5}));  // one treelet
  const std::vector<Ray> rays = awkward_rays(random, soup, 500);
  const auto compare = [&](TriangleTest test) {
    std::vector<std::vector<Ray>> ends;
    std::vector<TraceCounters> counted;
    for (const InnerLoop loop : {InnerLoop::kMoreNumerous, InnerLoop::kWhileWhile, InnerLoop::kIfIf}) {
      std::vector<Ray> found = rays;
      std::vector<RayContext> contexts(rays.size());
      std::vector<TraceJob> jobs;
      for (size_t i = 0; i < found.size(); ++i) {
        found[i].instance = 0;
        jobs.push_back(
            {f.scene.pages[0].bytes().data(), &found[i], &contexts[i], &f.scene.instances[0], f.scene.entries[0]});
      }
      TraceCounters counters;
      trace_treelets(jobs, counters, test, loop);
      ends.push_back(found), counted.push_back(counters);
    }
    expect_same_ends("", "while-while", ends[0], ends[1]);
    expect_same_ends("", "if-if", ends[0], ends[2]);
    EXPECT_EQ(counted[0].simd_lanes_count, 0u);
    for (int loop : {1, 2}) {
      EXPECT_EQ(counted[loop].node_tests_count, counted[0].node_tests_count);
      EXPECT_EQ(counted[loop].triangle_tests_count, counted[0].triangle_tests_count);
      EXPECT_LT(counted[loop].simd_active_lanes_count, counted[loop].simd_lanes_count);
    }
    EXPECT_NE(counted[1].simd_lanes_count, counted[2].simd_lanes_count);
  };
  on_every_instruction_set([&](const char* target) {
    SCOPED_TRACE(target);
    for (const TriangleTest test : {TriangleTest::kWatertight, TriangleTest::kFast, TriangleTest::kDouble}) compare(test);
  });
}

}  // namespace
}  // namespace shoal::testing
