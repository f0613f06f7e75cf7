// The heart of the floor: traversal through top tree and treelets gives, bit for bit, what testing every triangle
// gives.
#include <gtest/gtest.h>
#include <hwy/highway.h>

#include "tests/support/awkward_rays.h"
#include "tests/support/built_scene.h"
#include "tests/support/ray_list_stream.h"
#include "treelets/trace_treelet_scalar.h"

namespace shoal::testing {
namespace {

void expect_same(const Ray& expected, const Ray& found, size_t index) {
  ASSERT_EQ(expected.hit.valid(), found.hit.valid()) << "ray " << index;
  if (expected.any_hit() || !expected.hit.valid()) return;
  ASSERT_EQ(expected.t, found.t) << "ray " << index;
  ASSERT_EQ(expected.hit.instance, found.hit.instance) << "ray " << index;
  ASSERT_EQ(expected.hit.primitive, found.hit.primitive) << "ray " << index;
}

/// Scene by scene, ray by ray, for the product's kernels and the scalar reference. Returns the number of hits.
size_t compare(const TestScene& scene, const std::vector<Ray>& rays, uint32_t more_levels = 32) {
  EXPECT_TRUE(
      TopTree::check(scene.nodes, scene.entries, scene.instances, static_cast<uint32_t>(scene.pages.size())).ok());
  const TopTree tree(scene.nodes, scene.entries, scene.instances, {more_levels});
  for (const AlignedPage& page : scene.pages) EXPECT_TRUE(check_treelet(page.bytes()).ok());
  const std::vector<Ray> single = trace_together(tree, scene, rays, RayGrouping::kSingle);
  const std::vector<Ray> packets = trace_together(tree, scene, rays, RayGrouping::kPackets);
  std::vector<std::vector<Ray>> others;
  TraceCounters counters;
  for (const TraversalWay& way : kTraversalWays) others.push_back(trace_by(way, tree, scene, rays, counters));
  size_t hits = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    Ray expected = rays[i], scalar = rays[i], found = rays[i];
    brute_force(scene, expected);
    trace_scene(tree, scene.pages, scalar, trace_treelet_scalar);
    trace_scene(tree, scene.pages, found, trace_treelet);
    expect_same(expected, scalar, i);
    expect_same(expected, found, i);
    expect_same(expected, single[i], i);
    expect_same(expected, packets[i], i);
    for (const std::vector<Ray>& other : others) expect_same(expected, other[i], i);
    // Which occluder an any-hit ray finds depends on the order of its boxes, which are only conservative.
    if (!expected.any_hit()) {
      EXPECT_EQ(std::memcmp(&scalar, &found, sizeof(Ray)), 0) << "ray " << i;
      EXPECT_EQ(std::memcmp(&scalar, &single[i], sizeof(Ray)), 0) << "ray " << i;
      EXPECT_EQ(std::memcmp(&scalar, &packets[i], sizeof(Ray)), 0) << "ray " << i;
      for (const std::vector<Ray>& other : others) EXPECT_EQ(std::memcmp(&scalar, &other[i], sizeof(Ray)), 0) << "ray " << i;
    }
    if (::testing::Test::HasFatalFailure()) return hits;
    hits += expected.hit.valid();
  }
  return hits;
}

TEST(Trace, FindsWhatBruteForceFindsInASoup) {
  std::mt19937 random(1);
  const auto soup = random_soup(random, 2000, 0.1f);
  for (const TestSceneOptions options : {TestSceneOptions{5000, 4}, {200, 4}, {20, 8}, {7, 1}, {200, 3, true}}) {
    const TestScene scene = make_scene({soup}, {{0, {}}}, options);
    EXPECT_GT(compare(scene, awkward_rays(random, soup, 1000)), 350u);
  }
}

TEST(Trace, FindsWhatBruteForceFindsInAMesh) {
  std::mt19937 random(2);
  const auto mesh = closed_mesh(20, 40, 0.2f);
  for (const TestSceneOptions options : {TestSceneOptions{100, 4}, {1000, 8}, {50, 2, true}}) {
    const TestScene scene = make_scene({mesh}, {{0, {}}}, options);
    EXPECT_GT(compare(scene, awkward_rays(random, mesh, 1000)), 350u);
  }
}

TEST(Trace, FindsWhatBruteForceFindsInAxisAlignedGrids) {
  std::mt19937 random(3);
  std::vector<TestTriangle> grid;  // planes of squares: flat boxes, planes shared by many boxes
  for (int x = -8; x < 8; ++x) {
    for (int y = -8; y < 8; ++y) {
      for (int axis = 0; axis < 3; ++axis) {
        const auto corner = [&](int i, int j) {
          const float v[3] = {(x + i) * 0.125f, (y + j) * 0.125f, 0.25f * static_cast<float>(axis)};
          return Vec3(v[axis], v[(axis + 1) % 3], v[(axis + 2) % 3]);
        };
        const uint32_t id = static_cast<uint32_t>(grid.size());
        grid.push_back({{corner(0, 0), corner(1, 0), corner(0, 1)}, id});
        grid.push_back({{corner(1, 0), corner(1, 1), corner(0, 1)}, id + 1});
      }
    }
  }
  for (const TestSceneOptions options : {TestSceneOptions{100, 4}, {2000, 8}, {50, 2, true}}) {
    const TestScene scene = make_scene({grid}, {{0, {}}}, options);
    EXPECT_GT(compare(scene, awkward_rays(random, grid, 1000)), 350u);
  }
}

TEST(Trace, FindsWhatBruteForceFindsAmongInstances) {
  std::mt19937 random(4);
  const auto soup = random_soup(random, 300, 0.3f);
  const auto mesh = closed_mesh(10, 16, 0.2f, 300);
  std::vector<Placement> placements{{0, {}}};
  for (int i = 0; i < 30; ++i) {  // rotated, scaled, sheared, mirrored
    Placement p;
    p.object = random() % 2;
    p.object_to_world.column_x = random_vector(random);
    p.object_to_world.column_y = random_vector(random);
    p.object_to_world.column_z = random_vector(random, i % 7 == 0 ? 0.01f : 1.0f);
    p.object_to_world.translation = random_vector(random, i % 5 == 0 ? 50.0f : 2.0f);
    placements.push_back(p);
  }
  for (const uint32_t more_levels : {32u, 2u, 0u}) {
    for (const TestSceneOptions options : {TestSceneOptions{50, 4}, {1000, 8, true}}) {
      const TestScene scene = make_scene({soup, mesh}, placements, options);
      EXPECT_GT(compare(scene, awkward_rays(random, soup, 500), more_levels), 150u);
    }
  }
}

TEST(Trace, FindsHitsOnTheVeryFacesOfInstances) {
  // Flat objects whose world boxes are flat too, met in their planes, on their corners and from afar: what the
  // object space accepts, the boxes of the world must not lose.
  std::mt19937 random(7);
  const std::vector<TestTriangle> square{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 0},
                                         {{{1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, 1}};
  std::vector<Placement> placements;
  for (int i = 0; i < 60; ++i) {
    Placement p;
    const float scale = i % 3 == 0 ? 0.001f : 1.7f;
    const int axis = i % 3;
    p.object_to_world.column_x = Vec3(0), p.object_to_world.column_y = Vec3(0),
    p.object_to_world.column_z = Vec3(0);
    p.object_to_world.column_x[axis] = scale;
    p.object_to_world.column_y[(axis + 1) % 3] = -scale;
    p.object_to_world.column_z[(axis + 2) % 3] = 0.3f;
    if (i % 4 == 0) p.object_to_world.column_x[(axis + 1) % 3] = 123.4f * scale;
    p.object_to_world.translation = random_vector(random, i % 2 ? 10.0f : 1000.0f);
    placements.push_back(p);
  }
  const TestScene scene = make_scene({square}, placements);
  std::vector<Ray> rays;
  for (int i = 0; i < 10000; ++i) {
    const Affine3& m = placements[random() % placements.size()].object_to_world;
    const float u = static_cast<float>(random() % 3) * 0.5f, v = static_cast<float>(random() % 3) * 0.5f;
    // Beside a corner or an edge by as much as the transform to object space may err.
    const Vec3 target = m.point({u, v, 0}) + random_vector(random, 4e-7f * max_abs(&m.translation.x));
    Vec3 origin = target + random_vector(random, i % 2 ? 3.0f : 3000.0f);
    if (i % 3 == 0) origin = m.point({3.0f, v, 0});  // in the plane
    rays.push_back(make_ray(origin, target - origin));
  }
  EXPECT_GT(compare(scene, rays), 1000u);
}

TEST(Trace, TheSizeOfTreeletsCannotChangeAHit) {
  std::mt19937 random(9);
  const auto soup = random_soup(random, 3000, 0.1f);
  const auto mesh = closed_mesh(12, 24, 0.2f, 3000);
  Placement turned;
  turned.object = 1;
  turned.object_to_world = {{0.3f, 0.4f, 0}, {-0.4f, 0.3f, 0.1f}, {0, 0, -0.5f}, {0.5f, -2, 1}};
  const auto rays = awkward_rays(random, soup, 500);
  for (const uint32_t treelet_bytes : {4u << 10, 16u << 10, 256u << 10, 4u << 20}) {
    EXPECT_GT(compare(build_scene({soup}, {{0, {}}}, treelet_bytes), rays), 150u);
    EXPECT_GT(compare(build_scene({soup, mesh}, {{0, {}}, turned, {1, {}}}, treelet_bytes), rays), 150u);
  }
}

TEST(Trace, ScalesOfCoordinatesDoNotMatter) {
  std::mt19937 random(5);
  for (const float scale : {1e-30f, 1e-10f, 1e10f, 1e18f}) {
    auto soup = random_soup(random, 500, 0.2f);
    auto rays = awkward_rays(random, soup, 500);
    for (auto& t : soup) {
      for (auto& p : t.p) p *= scale;
    }
    for (auto& r : rays) r.origin *= scale;
    compare(make_scene({soup}, {{0, {}}}, {50, 4}), rays);
  }
}

TEST(Trace, DuplicatesResolveToTheSmallestId) {
  std::mt19937 random(6);
  auto soup = random_soup(random, 50, 0.5f);
  const std::vector<TestTriangle> original = soup;
  for (int copy = 1; copy < 5; ++copy) {
    for (TestTriangle t : original) {
      t.primitive += static_cast<uint32_t>(50 * copy);
      soup.push_back(t);
    }
  }
  std::shuffle(soup.begin(), soup.end(), random);
  const TestScene scene = make_scene({soup}, {{0, {}}, {0, {}}}, {20, 3});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  size_t hits = 0;
  for (Ray ray : awkward_rays(random, soup, 2000)) {
    ray.path = 0;
    trace_scene(tree, scene.pages, ray, trace_treelet);
    if (!ray.hit.valid()) continue;
    ++hits;
    EXPECT_EQ(ray.hit.instance, 0u);
    EXPECT_LT(ray.hit.primitive, 50u);
  }
  EXPECT_GT(hits, 300u);
}

/// Half of the rays from one place in like directions, in runs of thousands, so that packets are left and taken up.
std::vector<Ray> changing_rays(std::mt19937& random, const std::vector<TestTriangle>& triangles, size_t count) {
  std::vector<Ray> rays;
  std::uniform_real_distribution<float> uniform(0, 1);
  while (rays.size() < count) {
    const std::vector<Ray> awkward = awkward_rays(random, triangles, 3000);
    rays.insert(rays.end(), awkward.begin(), awkward.end());
    for (int i = 0; i < 6000; ++i) {
      rays.push_back(make_ray({0.1f, 0.2f, 3}, {0.3f * uniform(random), 0.3f * uniform(random), -1}));
    }
  }
  return rays;
}

TEST(SceneTracer, LosesNoRayWhateverTheStreamSaysAndHoweverItChangesItsWays) {
  std::mt19937 random(9);
  const auto soup = random_soup(random, 2000, 0.1f);
  const TestScene scene = make_scene({soup}, {{0, {}}}, {200, 4});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  const std::vector<Ray> rays = changing_rays(random, soup, 80000);
  std::vector<Ray> expected = rays;
  for (Ray& ray : expected) trace_scene(tree, scene.pages, ray, trace_treelet);
  for (const size_t most_out : {size_t{1}, size_t{40}, size_t{1000}, SIZE_MAX}) {
    for (const bool hesitates : {false, true}) {
      for (const RayGrouping grouping : {RayGrouping::kAuto, RayGrouping::kPackets, RayGrouping::kSingle}) {
        std::vector<Ray> found = rays;
        RayListStream stream(found, scene, most_out, hesitates);
        TraceCounters counters;
        SceneTracer tracer(tree, stream.table.data(), grouping);
        for (int call = 0; call < 200000 && stream.done_count < rays.size(); ++call) tracer.trace(stream, counters);
        ASSERT_EQ(stream.done_count, rays.size());
        for (size_t i = 0; i < rays.size(); ++i) {
          expect_same(expected[i], found[i], i);
          if (HasFatalFailure()) return;
        }
      }
    }
  }
}

TEST(SceneTracer, AnEmptySceneIsMissed) {
  const TestScene scene = make_scene({}, {});
  for (const TopTree& tree : {TopTree(), TopTree(scene.nodes, scene.entries, scene.instances)}) {
    for (const RayGrouping grouping : {RayGrouping::kAuto, RayGrouping::kPackets, RayGrouping::kSingle}) {
      const auto found = trace_together(tree, scene, {make_ray({0, 0, 0}, {1, 2, 3})}, grouping);
      EXPECT_FALSE(found[0].hit.valid());
    }
  }
}

/// Rays go around a treelet whose page cannot be had.
class FailingStream final : public RayStream {
 public:
  explicit FailingStream(std::vector<Ray>& rays) : rays_(rays) {}
  Ray* next() override { return next_ < rays_.size() ? &rays_[next_++] : nullptr; }
  void done(Ray&, const RayWork&) override { ++done_count; }
  const std::byte* bring(TreeletId) override { return nullptr; }
  size_t done_count = 0;

 private:
  std::vector<Ray>& rays_;
  size_t next_ = 0;
};

TEST(SceneTracer, EndsWhenNoPageCanBeHad) {
  std::mt19937 random(10);
  const auto soup = random_soup(random, 500, 0.1f);
  const TestScene scene = make_scene({soup}, {{0, {}}}, {50, 4});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  const std::vector<const std::byte*> none(scene.pages.size(), nullptr);
  for (const RayGrouping grouping : {RayGrouping::kPackets, RayGrouping::kSingle}) {
    std::vector<Ray> rays = awkward_rays(random, soup, 500);
    FailingStream stream(rays);
    TraceCounters counters;
    SceneTracer(tree, none.data(), grouping).trace(stream, counters);
    EXPECT_EQ(stream.done_count, rays.size());
    for (const Ray& ray : rays) EXPECT_FALSE(ray.hit.valid());
  }
}

/// To whole multiples of `step`, with one kind of zero.
std::vector<TestTriangle> rounded(std::vector<TestTriangle> triangles, float step) {
  for (TestTriangle& t : triangles) {
    for (Vec3& p : t.p) {
      for (int axis = 0; axis < 3; ++axis) p[axis] = std::nearbyint(p[axis] / step) * step + 0.0f;
    }
  }
  return triangles;
}

TEST(Trace, FindsWhatBruteForceFindsOnAGrid) {
  // From steps that take two bytes of offset, or do not fit, to some that take one and make triangles degenerate.
  std::mt19937 random(12);
  for (const float step : {0x1p-20f, 0x1p-16f, 0x1p-12f, 0x1p-7f, 0x1p-5f}) {
    const auto soup = rounded(random_soup(random, 1500, 0.1f), step);
    const auto mesh = rounded(closed_mesh(12, 24, 0.2f, 1500), step);
    Placement turned;
    turned.object = 1;
    turned.object_to_world = {{0.3f, 0.4f, 0}, {-0.4f, 0.3f, 0.1f}, {0, 0, -0.5f}, {0.5f, -2, 1}};
    const TestScene scene = build_scene({soup, mesh}, {{0, {}}, turned}, 16u << 10, step);
    EXPECT_GT(compare(scene, awkward_rays(random, soup, 500)), 150u) << step;
  }
}

TEST(Trace, GivesTheSameBitsOnEveryInstructionSet) {
  std::mt19937 random(8);
  const auto soup = random_soup(random, 1000, 0.2f), on_grid = rounded(soup, 0x1p-12f);
  const TestScene scene = make_scene({soup}, {{0, {}}}, {100, 7});
  const TestScene exact = build_scene({soup}, {{0, {}}}, 8u << 10);
  const TestScene grid = build_scene({on_grid}, {{0, {}}}, 8u << 10, 0x1p-12f);
  const auto rays = awkward_rays(random, soup, 1000);
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    EXPECT_GT(compare(scene, rays), 300u) << hwy::TargetName(target);
    EXPECT_GT(compare(exact, rays), 300u) << hwy::TargetName(target);
    EXPECT_GT(compare(grid, rays), 300u) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace
}  // namespace shoal::testing
