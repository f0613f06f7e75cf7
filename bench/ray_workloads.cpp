#include "bench/ray_workloads.h"

#include <atomic>
#include <cmath>
#include <numeric>
#include <random>

#include "engine/camera.h"
#include "engine/emitters.h"
#include "engine/frame.h"
#include "engine/light_sampler.h"
#include "engine/sample_order.h"
#include "engine/surface_error.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kSeed = 1;
constexpr double kAspect = 16.0 / 9.0;
constexpr uint32_t kTargetTries = 8;  // until a point of an emitter lies above the surface

/// A point that rays leave from, and the side they leave to.
struct Surface {
  BoundedPoint point;
  Vec3 normal{0};  ///< unit
};

/// Towards the side that `from` names; degenerate triangles give one that points up.
Vec3 unit_normal(Vec3 normal, const Vec3& from) {
  const float length = glm::length(normal);
  normal = length > 0 && std::isfinite(length) ? normal / length : Vec3(0, 1, 0);
  return glm::dot(normal, from) < 0 ? -normal : normal;
}

Surface surface_at(const MemoryScene& scene, const Ray& ray) {
  const Instance& instance = scene.top_tree().instance(ray.hit.instance);
  const TreeletTriangle triangle = find_triangle(scene.pages[ray.hit.treelet], ray.hit.slot);
  const TrianglePoint at = intersect_known(ray, instance, triangle);
  const Vec3 normal = glm::cross(triangle.p1 - triangle.p0, triangle.p2 - triangle.p0);
  return {to_world(point_on_triangle(triangle.p0, triangle.p1, triangle.p2, at.b1, at.b2), instance),
          unit_normal(instance.world_to_object.transposed_vector(normal), -ray.direction)};
}

BenchRay cosine_ray(const Surface& surface, float u1, float u2) {
  return {offset_point(surface.point, surface.normal), kRayInfinity,
          Frame(surface.normal).to_world(sample_cosine_hemisphere(u1, u2))};
}

/// Points of emitters, as many a square metre on each.
class EmitterPoints {
 public:
  explicit EmitterPoints(const Scene& scene) : scene_(scene) {
    for (const Emitter& emitter : scene.emitters) {
      sums_.push_back(emitter_area(emitter) + (sums_.empty() ? 0 : sums_.back()));
    }
  }

  /// A ray from `surface` that ends just before a point of an emitter; t = 0 when the point lies below.
  BenchRay ray_from(const Surface& surface, const Random4& random) const {
    const double wanted = random.uniform(0) * sums_.back();
    const auto at = std::upper_bound(sums_.begin(), sums_.end() - 1, wanted);
    const Emitter& emitter = scene_.emitters[static_cast<size_t>(at - sums_.begin())];
    const auto corner = [&](int i) {
      return Vec3(emitter.position[3 * i], emitter.position[3 * i + 1], emitter.position[3 * i + 2]);
    };
    float b1 = random.uniform(1), b2 = random.uniform(2);
    if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
    const Instance& instance = scene_.top_tree.instance(emitter.instance);
    BoundedPoint target = point_on_triangle(corner(0), corner(1), corner(2), b1, b2);
    target.error += instance_error(target.point, instance);
    const Vec3 origin = offset_point(surface.point, surface.normal);
    const Vec3 normal = unit_normal(glm::cross(corner(1) - corner(0), corner(2) - corner(0)), origin - target.point);
    const Vec3 direction = offset_point(ray_end(target, origin, &instance), normal) - origin;
    return {origin, glm::dot(direction, surface.normal) > 0 ? 1.0f : 0.0f, direction};
  }

 private:
  const Scene& scene_;
  std::vector<double> sums_;  ///< of areas
};

}  // namespace

RayWorkloads::RayWorkloads(const MemoryScene& scene, const WorldMesh& mesh, uint64_t ray_count, unsigned threads)
    : scene_(scene), mesh_(mesh), ray_count_(ray_count), threads_(threads) {}

Result<RaySet> RayWorkloads::make(const std::string& name) {
  RaySet set;
  set.name = name;
  set.coherent = name == "primary";
  set.any_hit = name == "shadow";
  if (name == "primary") {
    set.rays = primary_rays();
  } else if (name == "scene-random") {
    set.rays = scene_random_rays();
  } else if (name == "diffuse2") {
    SHOAL_ASSIGN_OR_RETURN(const std::vector<Ray>* hits, diffuse_hits());
    set.rays = bounces(*hits, 2);
  } else {
    SHOAL_ASSIGN_OR_RETURN(const std::vector<Ray>* hits, primary_hits());
    set.rays = set.any_hit ? shadow_rays(*hits) : bounces(*hits, 1);
  }
  if (name == "shuffled") std::shuffle(set.rays.begin(), set.rays.end(), std::mt19937_64(kSeed));
  if (set.rays.empty()) return Error{ErrorCode::kInput, scene_.scene.file->path() + ": no rays for " + name};
  return set;
}

Result<const std::vector<Ray>*> RayWorkloads::primary_hits() {
  if (primary_hits_.empty()) primary_hits_ = hits_of(primary_rays());
  if (primary_hits_.empty()) return Error{ErrorCode::kInput, scene_.scene.file->path() + ": the camera sees nothing"};
  return &primary_hits_;
}

Result<const std::vector<Ray>*> RayWorkloads::diffuse_hits() {
  if (diffuse_hits_.empty()) {
    SHOAL_ASSIGN_OR_RETURN(const std::vector<Ray>* hits, primary_hits());
    diffuse_hits_ = hits_of(bounces(*hits, 1));
  }
  if (diffuse_hits_.empty()) return Error{ErrorCode::kInput, scene_.scene.file->path() + ": bounces hit nothing"};
  return &diffuse_hits_;
}

std::vector<Ray> RayWorkloads::hits_of(const LargeVector<BenchRay>& rays) const {
  std::vector<Ray> traced(rays.size());
  std::atomic<uint64_t> next{0};
  run_together(threads_, [&](unsigned) {
    for (uint64_t first; (first = next.fetch_add(kRaysPerGrab)) < rays.size();) {
      for (uint64_t i = first; i < std::min<uint64_t>(first + kRaysPerGrab, rays.size()); ++i) {
        traced[i] = begin_ray(rays[i], static_cast<uint32_t>(i), false);
        trace_to_end(scene_, traced[i]);
      }
    }
  });
  std::erase_if(traced, [](const Ray& ray) { return !ray.hit.valid(); });
  return traced;
}

LargeVector<BenchRay> RayWorkloads::primary_rays() const {
  const auto height = static_cast<uint32_t>(std::max(1.0, std::sqrt(static_cast<double>(ray_count_) / kAspect)));
  const auto width = static_cast<uint32_t>(std::max<uint64_t>(1, ray_count_ / height));
  const SampleOrder order(width, height, 1);
  const Scene& scene = scene_.scene;
  const Camera camera(scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[0], width, height);
  LargeVector<BenchRay> rays(order.count());
  for (uint64_t i = 0; i < rays.size(); ++i) {
    const PixelSample at = order.at(i);
    const CameraRay ray = camera.ray(at.x, at.y, random4(kSeed, at.y * width + at.x, 0, 0, Dimension::kPixel));
    rays[i] = {ray.origin, kRayInfinity, ray.direction};
  }
  return rays;
}

/// Where there are fewer hits than rays wanted, rays of one hit come after one another.
LargeVector<BenchRay> RayWorkloads::bounces(const std::vector<Ray>& hits, uint32_t bounce) const {
  LargeVector<BenchRay> rays(ray_count_);
  for (uint64_t i = 0; i < rays.size(); ++i) {
    const Random4 random = random4(kSeed, static_cast<uint32_t>(i), 0, bounce, Dimension::kBsdf);
    rays[i] = cosine_ray(surface_at(scene_, hits[i * hits.size() / rays.size()]), random.uniform(0), random.uniform(1));
  }
  return rays;
}

LargeVector<BenchRay> RayWorkloads::scene_random_rays() const {
  std::mt19937_64 random(kSeed);
  LargeVector<BenchRay> rays(ray_count_);
  for (uint64_t i = 0; i < rays.size(); ++i) {
    const uint64_t triangle = random() % mesh_.triangle_count();
    const Vec3 p0 = mesh_.position(triangle, 0), p1 = mesh_.position(triangle, 1), p2 = mesh_.position(triangle, 2);
    const Random4 at = random4(kSeed, static_cast<uint32_t>(i), 1, 0, Dimension::kBsdf);
    const Random4 to = random4(kSeed, static_cast<uint32_t>(i), 2, 0, Dimension::kBsdf);
    float b1 = at.uniform(0), b2 = at.uniform(1);
    if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
    const Vec3 normal = unit_normal(glm::cross(p1 - p0, p2 - p0), Vec3(0));
    Surface surface{point_on_triangle(p0, p1, p2, b1, b2), at.uniform(2) < 0.5f ? -normal : normal};
    surface.point.error += instance_error(surface.point.point,
                                          scene_.top_tree().instance(mesh_.instance_of(triangle)));
    rays[i] = cosine_ray(surface, to.uniform(0), to.uniform(1));
  }
  return rays;
}

LargeVector<BenchRay> RayWorkloads::shadow_rays(const std::vector<Ray>& hits) const {
  LargeVector<BenchRay> rays;
  rays.reserve(ray_count_);
  const EmitterPoints emitters(scene_.scene);
  for (uint64_t i = 0; i < ray_count_; ++i) {
    const Surface surface = surface_at(scene_, hits[i * hits.size() / ray_count_]);
    BenchRay ray{};
    for (uint32_t attempt = 0; attempt < kTargetTries && !(ray.t > 0); ++attempt) {
      const Random4 random = random4(kSeed, static_cast<uint32_t>(i), attempt, 0, Dimension::kLight);
      ray = scene_.scene.emitters.empty() ? cosine_ray(surface, random.uniform(0), random.uniform(1))
                                          : emitters.ray_from(surface, random);
    }
    if (ray.t > 0) rays.push_back(ray);
  }
  return rays;
}

}  // namespace shoal::bench
