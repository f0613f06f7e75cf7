// Looks at a scene from above: a ray down for each cell of a grid over it, then from each hit a ray back up that
// asks whether anything is in the way. Prints what was hit and what it took to find out. Usage: trace_rays
// SCENE.shoal [CELLS_A_SIDE [MAX_MEMORY_MIB]]
#include <shoal/tracer.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

namespace {

using shoal::api::Bounds;
using shoal::api::Hit;
using shoal::api::Query;
using shoal::api::Ray;
using shoal::api::TraceReport;

int fail(const shoal::api::Error& error) {
  std::fprintf(stderr, "trace_rays: %s\n", error.message.c_str());
  return static_cast<int>(error.code);
}

std::vector<Ray> rays_from_above(const Bounds& bounds, uint32_t side) {
  std::vector<Ray> rays(static_cast<size_t>(side) * side);
  const float width = bounds.upper[0] - bounds.lower[0], depth = bounds.upper[2] - bounds.lower[2];
  const float height = bounds.upper[1] - bounds.lower[1];
  for (uint32_t i = 0; i < rays.size(); ++i) {
    const float column = static_cast<float>(i % side) + 0.5f, row = static_cast<float>(i / side) + 0.5f;
    Ray& ray = rays[i];
    ray.origin[0] = bounds.lower[0] + width * column / static_cast<float>(side);
    ray.origin[1] = bounds.upper[1] + height + 1;
    ray.origin[2] = bounds.lower[2] + depth * row / static_cast<float>(side);
    ray.direction[1] = -1;
    ray.direction[2] = 0;
  }
  return rays;
}

/// Of each hit, the way back to where its ray came from, but for a thousandth: is anything in between?
std::vector<Ray> rays_back(std::span<const Ray> rays, std::span<const Hit> hits) {
  std::vector<Ray> back;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].hit) continue;
    Ray ray = rays[i];
    for (int axis = 0; axis < 3; ++axis) {
      ray.origin[axis] += hits[i].t * ray.direction[axis];
      ray.direction[axis] = -ray.direction[axis];
    }
    ray.t_min = 1e-3f * hits[i].t;
    ray.t_max = hits[i].t;
    back.push_back(ray);
  }
  return back;
}

void print(const char* name, const TraceReport& report) {
  std::printf("%s: %llu rays, %llu hits, %llu treelets visited, %llu pages and %llu bytes read\n", name,
              static_cast<unsigned long long>(report.rays), static_cast<unsigned long long>(report.hits),
              static_cast<unsigned long long>(report.treelet_visits),
              static_cast<unsigned long long>(report.page_loads),
              static_cast<unsigned long long>(report.disk_read_bytes));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: trace_rays SCENE.shoal [CELLS_A_SIDE [MAX_MEMORY_MIB]]\n");
    return 2;
  }
  const auto side = static_cast<uint32_t>(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 256);
  const auto scene = shoal::api::Scene::open(argv[1]);
  if (!scene.ok()) return fail(scene.error());
  std::printf("libshoal %s: %llu triangles, %u instances\n", shoal::api::version(),
              static_cast<unsigned long long>(scene.value().triangle_count()), scene.value().instance_count());

  shoal::api::TracerOptions options;
  options.max_memory_bytes = argc > 3 ? std::strtoull(argv[3], nullptr, 10) << 20 : 0;
  options.barycentrics = true;
  auto tracer = shoal::api::Tracer::create(scene.value(), options);
  if (!tracer.ok()) return fail(tracer.error());

  const std::vector<Ray> down = rays_from_above(scene.value().bounds(), side);
  std::vector<Hit> hits(down.size());
  const auto closest = tracer.value().trace(down, hits, Query::kClosest);
  if (!closest.ok()) return fail(closest.error());
  print("closest hit", closest.value());
  for (size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].hit) continue;
    std::printf("first: triangle %u of instance %u at t = %g, u = %g, v = %g\n", hits[i].primitive,
                hits[i].instance, static_cast<double>(hits[i].t), static_cast<double>(hits[i].u),
                static_cast<double>(hits[i].v));
    break;
  }

  const std::vector<Ray> up = rays_back(down, hits);
  std::vector<Hit> blocked(up.size());
  const auto any = tracer.value().trace(up, blocked, Query::kAny);
  if (!any.ok()) return fail(any.error());
  print("any hit", any.value());
  return 0;
}
