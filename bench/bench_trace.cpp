// Rays a second through a scene in memory: our treelets by each triangle test (what the robust path costs) beside Embree's
// rtcIntersect1, as it comes and robust. Incoherent rays, one thread.
//   bench_trace [triangles, default 1000000] [rays, default 300000] [treelet KiB, default 256] [soup|mesh]
// soup: triangles that share nothing, about as large as their distance; mesh: nested bumpy spheres, vertices
// shared. Prints a line a contender: million rays a second, its time beside that of the default test, and for ours tests
// and treelets a ray. They take turns: one warm-up, then the median of five.
#include <fmt/format.h>
#include <time.h>

#include <cstdlib>

#include "tests/support/built_scene.h"
#include "tests/support/embree_peer.h"

namespace shoal::testing {
namespace {

/// Time of this thread alone, so that a busy machine does not count.
double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Rays traced together.
constexpr size_t kGroup = 64;

/// Each ray to its end, a treelet of each at a time.
void trace_group(const TestScene& scene, const TopTree& tree, std::span<Ray> rays, uint64_t& top_tests,
                 uint64_t& visits, TraceCounters& counters, TriangleTest test) {
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
    trace_treelets({jobs, count}, counters, test);
    left = 0;
    for (uint32_t k = 0; k < count; ++k) {
      if (!next[k].ray->any_hit() || !next[k].ray->hit.valid()) next[left++] = next[k];
    }
    count = left;
  }
}

/// Of all rays.
struct Work {
  uint64_t hits = 0, top_tests = 0, visits = 0;
  TraceCounters inside;
};

Work run_ours(const TestScene& scene, const std::vector<Ray>& rays, TriangleTest test) {
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  Work work;
  std::vector<Ray> group;
  for (size_t first = 0; first < rays.size(); first += kGroup) {
    group.assign(rays.begin() + static_cast<long>(first),
                 rays.begin() + static_cast<long>(std::min(first + kGroup, rays.size())));
    trace_group(scene, tree, group, work.top_tests, work.visits, work.inside, test);
    for (const Ray& ray : group) work.hits += ray.hit.valid();
  }
  return work;
}

struct Contender {
  std::string name;
  std::function<Work()> trace;
  bool ours = false;
  Work work{};
  std::vector<double> seconds{};  ///< of each round
  double median() const {
    std::vector<double> sorted = seconds;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
};

void compete(std::vector<Contender>& contenders) {
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    for (Contender& contender : contenders) {
      const double start = thread_seconds();
      contender.work = contender.trace();
      if (round > 0) contender.seconds.push_back(thread_seconds() - start);
    }
  }
}

void print(const Contender& contender, double default_seconds, double rays) {
  const Work& work = contender.work;
  const auto each = [rays](uint64_t count) { return static_cast<double>(count) / rays; };
  fmt::print("{:<16} {:.3f} Mrays/s  time {:.3f}  hits {:.4f}", contender.name, rays / contender.median() * 1e-6,
             contender.median() / default_seconds, each(work.hits));
  if (contender.ours) {
    fmt::print("  top nodes {:.1f}  treelets {:.2f}  nodes {:.1f}  triangles {:.1f}", each(work.top_tests),
               each(work.visits), each(work.inside.node_tests_count), each(work.inside.triangle_tests_count));
  }
  fmt::print("\n");
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
  const EmbreePeer plain(soup, false), robust(soup, true);
  const auto embree = [&rays](const EmbreePeer& peer) { return Work{rays.size() - peer.misses(rays), 0, 0, {}}; };
  std::vector<Contender> contenders;
  for (const TriangleTest test : {TriangleTest::kWatertight, TriangleTest::kFast, TriangleTest::kDouble}) {
    contenders.push_back({"ours, " + std::string(triangle_test_name(test)), [&, test] { return run_ours(scene, rays, test); },
                          true});
  }
  contenders.push_back({"Embree", [&] { return embree(plain); }});
  contenders.push_back({"Embree, robust", [&] { return embree(robust); }});
  compete(contenders);
  for (const Contender& contender : contenders) {
    print(contender, contenders[0].median(), static_cast<double>(rays.size()));
  }
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
