// Rays a second through a scene in memory: our treelets against Embree's rtcIntersect1, incoherent rays, one
// thread.
//   bench_trace [triangles, default 1000000] [rays, default 300000] [treelet KiB, default 256] [soup|mesh]
// soup: triangles that share nothing, about as large as their distance; mesh: nested bumpy spheres, vertices
// shared. Prints a line a program: million rays a second, and for ours tests and treelets a ray. One warm-up,
// median of five.
#include <embree3/rtcore.h>
#include <fmt/format.h>
#include <time.h>

#include <cstdlib>

#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

/// Time of this thread alone, so that a busy machine does not count.
double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double median_seconds(const std::function<void()>& work) {
  std::vector<double> seconds;
  for (int run = 0; run < 6; ++run) {
    const double start = thread_seconds();
    work();
    seconds.push_back(thread_seconds() - start);
  }
  std::sort(seconds.begin() + 1, seconds.end());
  return seconds[3];
}

/// Rays traced together.
constexpr size_t kGroup = 64;

/// Each ray to its end, a treelet of each at a time.
void trace_group(const TestScene& scene, const TopTree& tree, std::span<Ray> rays, uint64_t& top_tests,
                 uint64_t& visits, TraceCounters& counters) {
  RayContext contexts[kGroup];
  NextJob next[kGroup];
  uint32_t count = 0;
  for (Ray& ray : rays) next[count] = {&ray, &contexts[count]}, ++count;
  TraceJob jobs[kGroup];
  while (count > 0) {
    tree.next({next, count});
    uint32_t left = 0;
    for (uint32_t k = 0; k < count; ++k) {
      top_tests += next[k].node_tests;
      if (next[k].entry == kNoIndex) continue;
      const TreeletEntry& e = tree.entry(next[k].entry);
      Ray& ray = *next[k].ray;
      jobs[left] = {scene.pages[e.treelet].bytes().data(), &ray,
                    next[k].context, &tree.instance(ray.instance), e};
      next[left++] = {&ray, next[k].context};
    }
    count = left;
    visits += count;
    trace_treelets({jobs, count}, counters);
    left = 0;
    for (uint32_t k = 0; k < count; ++k) {
      if (!next[k].ray->any_hit() || !next[k].ray->hit.valid()) next[left++] = next[k];
    }
    count = left;
  }
}

void run_ours(const TestScene& scene, const std::vector<Ray>& rays) {
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  TraceCounters counters;
  uint64_t top_tests = 0, visits = 0, hits = 0;
  const double seconds = median_seconds([&] {
    counters = {}, top_tests = visits = hits = 0;
    std::vector<Ray> group;
    for (size_t first = 0; first < rays.size(); first += kGroup) {
      group.assign(rays.begin() + static_cast<long>(first),
                   rays.begin() + static_cast<long>(std::min(first + kGroup, rays.size())));
      trace_group(scene, tree, group, top_tests, visits, counters);
      for (const Ray& ray : group) hits += ray.hit.valid();
    }
  });
  const double n = static_cast<double>(rays.size());
  fmt::print(
      "ours    {:.3f} Mrays/s  hits {:.3f}  top nodes {:.1f}  treelets {:.2f}  nodes {:.1f}  triangles {:.1f}\n",
      n / seconds * 1e-6, static_cast<double>(hits) / n, static_cast<double>(top_tests) / n,
      static_cast<double>(visits) / n, static_cast<double>(counters.node_tests_count) / n,
      static_cast<double>(counters.triangle_tests_count) / n);
}

void run_embree(const std::vector<TestTriangle>& triangles, const std::vector<Ray>& rays) {
  RTCDevice device = rtcNewDevice("threads=2");
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * triangles.size()));
  auto* indices = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size()));
  for (size_t i = 0; i < 3 * triangles.size(); ++i) {
    std::memcpy(vertices + 3 * i, &triangles[i / 3].p[i % 3], 12);
    indices[i] = static_cast<uint32_t>(i);
  }
  rtcCommitGeometry(mesh);
  rtcAttachGeometry(scene, mesh);
  rtcReleaseGeometry(mesh);
  rtcCommitScene(scene);
  uint64_t hits = 0;
  const double seconds = median_seconds([&] {
    hits = 0;
    for (const Ray& ray : rays) {
      RTCRayHit query{};
      query.ray.org_x = ray.origin.x, query.ray.org_y = ray.origin.y, query.ray.org_z = ray.origin.z;
      query.ray.dir_x = ray.direction.x, query.ray.dir_y = ray.direction.y, query.ray.dir_z = ray.direction.z;
      query.ray.tfar = ray.t, query.ray.mask = 0xffffffffu;
      query.hit.geomID = query.hit.primID = RTC_INVALID_GEOMETRY_ID;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcIntersect1(scene, &context, &query);
      hits += query.hit.primID != RTC_INVALID_GEOMETRY_ID;
    }
  });
  fmt::print("Embree  {:.3f} Mrays/s  hits {:.3f}\n", static_cast<double>(rays.size()) / seconds * 1e-6,
             static_cast<double>(hits) / static_cast<double>(rays.size()));
  rtcReleaseScene(scene);
  rtcReleaseDevice(device);
}

/// Eight nested bumpy spheres.
std::vector<TestTriangle> nested_spheres(size_t triangle_count) {
  std::vector<TestTriangle> all;
  const uint32_t rows = static_cast<uint32_t>(std::sqrt(static_cast<double>(triangle_count) / 32));
  for (int shell = 1; shell <= 8; ++shell) {
    for (TestTriangle t : closed_mesh(rows, 2 * rows, 0.2f, static_cast<uint32_t>(all.size()))) {
      for (Vec3& p : t.p) p *= 0.1f * static_cast<float>(shell);
      all.push_back(t);
    }
  }
  return all;
}

void run(size_t triangle_count, size_t ray_count, uint32_t treelet_bytes, bool mesh) {
  std::mt19937 random(1);
  const float size = 2.0f / std::cbrt(static_cast<float>(triangle_count));
  const auto soup = mesh ? nested_spheres(triangle_count) : random_soup(random, triangle_count, size);
  std::vector<Ray> rays;
  for (size_t i = 0; i < ray_count; ++i) rays.push_back(make_ray(random_vector(random), random_vector(random)));
  const TestScene scene = build_scene({soup}, {{0, {}}}, treelet_bytes);
  size_t bytes = 0;
  for (const AlignedPage& page : scene.pages) bytes += page.bytes().size();
  fmt::print("{} triangles, {} treelets, {:.1f} bytes a triangle, {} top nodes\n", soup.size(), scene.pages.size(),
             static_cast<double>(bytes) / static_cast<double>(soup.size()), scene.nodes.size());
  run_ours(scene, rays);
  run_embree(soup, rays);
}

}  // namespace
}  // namespace shoal::testing

int main(int argc, char** argv) {
  const auto number = [&](int i, unsigned long fallback) {
    return argc > i ? std::strtoul(argv[i], nullptr, 10) : fallback;
  };
  const bool mesh = argc > 4 && std::string(argv[4]) == "mesh";
  shoal::testing::run(number(1, 1000000), number(2, 300000), static_cast<uint32_t>(number(3, 256)) << 10, mesh);
}
