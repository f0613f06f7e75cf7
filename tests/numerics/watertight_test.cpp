// Nothing leaks: rays from inside closed meshes at their edges and corners, scaled, moved and as instances. Beside each
// count what Embree, as it comes and robust, lets through. `[numerics]` lines are the table of docs/numerics.md.
#include <gtest/gtest.h>

#include "tests/support/embree_peer.h"
#include "tests/numerics/every_kernel.h"
#include "tests/numerics/watertight_meshes.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

constexpr size_t kBatch = 1000;
/// One batch in so many goes through every kernel on every instruction set, the others through the best one's.
constexpr size_t kEveryWay = 10;
/// Rays of the whole suite; each mesh and each change of it gets its share.
constexpr size_t kRays = 1'000'000;

size_t misses(const std::vector<Ray>& rays) {
  size_t missed = 0;
  for (const Ray& ray : rays) missed += ray.hit.valid() ? 0 : 1;
  return missed;
}

/// Rays that pass through the scene, in batches of `make(count)`; none may.
template <class Make>
size_t count_leaks(const TestScene& scene, TriangleTest test, size_t rays, const Make& make) {
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  size_t leaks = 0;
  for (size_t done = 0; done < rays && !::testing::Test::HasFatalFailure(); done += kBatch) {
    const std::vector<Ray> batch = make(kBatch);
    if (done / kBatch % kEveryWay == 0) {
      leaks += misses(trace_every_way(scene, batch, test));
    } else if (done / kBatch % 2 == 0) {
      leaks += misses(trace_together(tree, scene, batch, RayGrouping::kPackets, test));
    } else {
      leaks += misses(trace_one_by_one(tree, scene, batch, [&](auto page, const auto& entry, const auto& instance,
                                                               Ray& ray) {
        TraceCounters counters;
        trace_treelet(page, entry, instance, ray, counters, test);
      }));
    }
  }
  return leaks;
}

size_t round_up_to_batches(size_t rays) { return (rays + kBatch - 1) / kBatch * kBatch; }

/// The mesh by both watertight tests; prints a line of the table with what `fast` and Embree let through of 20,000 rays.
void expect_tight(const ClosedMesh& mesh, const char* change, size_t rays) {
  SCOPED_TRACE(mesh.name + ", " + change);
  const TestScene scene = build_scene({mesh.triangles}, {{0, {}}}, 16u << 10);
  std::mt19937 random(1);
  const auto make = [&](size_t count) { return rays_from_inside(mesh, random, count); };
  rays = round_up_to_batches(rays);
  const size_t leaks = count_leaks(scene, TriangleTest::kWatertight, rays, make);
  const size_t double_leaks = count_leaks(scene, TriangleTest::kDouble, round_up_to_batches(rays / 10), make);
  const size_t beside = round_up_to_batches(rays / 10);
  const size_t fast_leaks = count_leaks(scene, TriangleTest::kFast, beside, make);
  const std::vector<Ray> same = make(beside);
  const size_t embree = EmbreePeer(mesh.triangles, false).misses(same);
  const size_t robust = EmbreePeer(mesh.triangles, true).misses(same);
  std::printf("[numerics] | %s, %s | %zu | %zu | %zu | %zu | %zu | %zu | %zu |\n", mesh.name.c_str(), change, rays, leaks,
              double_leaks, beside, fast_leaks, embree, robust);
  EXPECT_EQ(leaks, 0u);
  EXPECT_EQ(double_leaks, 0u);
}

TEST(Watertight, ClosedMeshesAsTheyAre) {
  const auto meshes = closed_meshes();
  for (const ClosedMesh& mesh : meshes) expect_tight(mesh, "as it is", rays_to_try(kRays * 3 / 5) / meshes.size());
}

TEST(Watertight, ScaledByPowersOfTwo) {
  const auto meshes = closed_meshes();
  const int powers[] = {-100, -60, -40, -20, 20, 40, 60, 100};
  for (const ClosedMesh& original : meshes) {
    if (original.triangles.size() > 5000) continue;
    for (const int power : powers) {
      ClosedMesh mesh = original;
      const float by = std::ldexp(1.0f, power);
      for (TestTriangle& t : mesh.triangles) {
        for (Vec3& p : t.p) p *= by;
      }
      mesh.inside *= by, mesh.room *= by;
      expect_tight(mesh, ("times 2^" + std::to_string(power)).c_str(), rays_to_try(kRays / 4) / meshes.size() / std::size(powers));
    }
  }
}

TEST(Watertight, FarFromTheOrigin) {
  for (const ClosedMesh& original : closed_meshes()) {
    if (original.room < 0.05f) continue;  // nothing of it would be left
    ClosedMesh mesh = original;
    const Vec3 shift(1e7f, -1e7f, 0.9e7f);
    mesh.triangles.clear();
    for (TestTriangle t : original.triangles) {
      for (Vec3& p : t.p) p = p * 4096.0f + shift;
      if (t.p[0] != t.p[1] && t.p[1] != t.p[2] && t.p[2] != t.p[0]) mesh.triangles.push_back(t);
    }
    number_triangles(mesh.triangles);
    mesh.inside = mesh.inside * 4096.0f + shift, mesh.room *= 4096;
    expect_tight(mesh, "times 4096 and 1e7 away", rays_to_try(kRays / 80));
  }
}

TEST(Watertight, AsInstancesScaledShearedAndMirrored) {
  std::mt19937 random(2);
  const Affine3 maps[] = {{{1e-3f, 0, 0}, {0, 1e-3f, 0}, {0, 0, 1e-3f}, {5, 6, 7}},        // scaled
                          {{1000, 0, 0}, {0, 1, 0}, {0, 0, 0.01f}, {-3, 0, 100}},          // by different numbers
                          {{1, 0, 0}, {30, 1, 0}, {-7, 20, 1}, {1, 1, 1}},                 // sheared
                          {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1e4f}},                // mirrored
                          {{0.3f, 0.5f, -0.7f}, {0.6f, -0.8f, 0.2f}, {-0.4f, 0.1f, 0.9f}, {0.1f, -20, 3}}};
  size_t all = 0, leaks = 0;
  for (const ClosedMesh& mesh : closed_meshes()) {
    if (mesh.room < 0.05f || mesh.triangles.size() > 9000) continue;
    for (const Affine3& map : maps) {
      SCOPED_TRACE(mesh.name);
      const TestScene scene = build_scene({mesh.triangles}, {{0, map}}, 16u << 10);
      const auto make = [&](size_t count) {
        std::vector<Ray> rays = rays_from_inside(mesh, random, count);
        for (Ray& ray : rays) {
          const Vec3 origin = map.point(ray.origin), target = map.point(ray.origin + ray.direction);
          ray.origin = origin, ray.direction = target - origin;
        }
        return rays;
      };
      const size_t rays = round_up_to_batches(rays_to_try(kRays / 400));
      all += rays;
      leaks += count_leaks(scene, TriangleTest::kWatertight, rays, make);
      EXPECT_EQ(leaks, 0u);
      EXPECT_EQ(count_leaks(scene, TriangleTest::kDouble, kBatch, make), 0u);
    }
  }
  std::printf("[numerics] instances: %zu rays, %zu leaks\n", all, leaks);
}

}  // namespace
}  // namespace shoal::testing
