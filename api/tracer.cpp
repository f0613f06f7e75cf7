#include <algorithm>
#include <mutex>

#include "api/scene_impl.h"
#include "engine/trace_rays.h"

namespace shoal::api {
namespace {

shoal::Order order_below(Order order) {
  switch (order) {
    case Order::kAuto: return shoal::Order::kAuto;
    case Order::kQueued: return shoal::Order::kQueued;
    case Order::kDepthFirst: return shoal::Order::kDepthFirst;
    case Order::kSorted: return shoal::Order::kSorted;
    case Order::kHybrid: return shoal::Order::kHybrid;
  }
  return shoal::Order::kAuto;
}

Order order_above(shoal::Order order) {
  for (const Order known : {Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid}) {
    if (order_below(known) == order) return known;
  }
  return Order::kAuto;
}

/// The program's arrays, read and written where they lie.
class BatchSource final : public RaySource {
 public:
  BatchSource(std::span<const Ray> rays, std::span<Hit> hits, bool moves) : rays_(rays), hits_(hits), moves_(moves) {}

  QueryRay ray(uint64_t index) const override {
    const Ray& r = rays_[index];
    return {{r.origin[0], r.origin[1], r.origin[2]}, r.t_min, {r.direction[0], r.direction[1], r.direction[2]}, r.t_max,
            seed_of(r)};
  }
  void answer(uint64_t index, const RayHit& hit) override {
    hits_[index] = {hit.t, hit.u, hit.v, hit.instance, hit.object, hit.primitive, hit.hit};
  }

 private:
  uint32_t seed_of(const Ray& ray) const {
    uint32_t seed = ray.seed;
    if ((seed & 0xffffu) == QueryRay::kEveryTriangle) seed ^= 1;
    if (!moves_) return seed;
    const float time = ray.time > 0 ? std::min(ray.time, 1.0f) : 0.0f;
    return std::min(static_cast<uint32_t>(time * 0x1p16f), 0xffffu) << 16 | (seed & 0xffffu);
  }

  std::span<const Ray> rays_;
  std::span<Hit> hits_;
  bool moves_;
};

TraceReport public_report(const shoal::TraceReport& report) {
  const RenderCounters& counters = report.counters;
  const RayCounters rays = counters.total();
  TraceReport out;
  out.order = order_above(report.order.order);
  out.seconds = report.seconds;
  out.rays = rays.rays_traced_count;
  out.hits = rays.ray_hits_count;
  out.refused = report.refused_count;
  out.node_tests = rays.node_tests_count;
  out.triangle_tests = rays.triangle_tests_count;
  out.treelet_visits = counters.treelet_visits_count;
  out.page_loads = counters.treelet_loads_count;
  out.disk_read_bytes = counters.disk_read_bytes;
  out.peak_cache_bytes = report.peak_cache_bytes;
  out.peak_process_bytes = report.peak_process_bytes;
  return out;
}

}  // namespace

struct Tracer::Impl {
  std::shared_ptr<const Scene::Impl> scene;
  std::unique_ptr<RayTracer> tracer;
  std::mutex mutex{};  ///< one batch at a time
};

Tracer::Tracer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;
Tracer::~Tracer() = default;

Result<Tracer> Tracer::create(const Scene& scene, const TracerOptions& options) {
  return within_memory<Tracer>([&]() -> Result<Tracer> {
    TraceOptions below;
    below.execution.order = order_below(options.order);
    below.execution.threads = options.threads;
    below.execution.max_memory_bytes = options.max_memory_bytes;
    below.kept_bytes = options.reserved_bytes;
    below.largest_list = options.largest_batch;
    below.points = options.barycentrics;
    below.coverage = options.alpha;
    auto tracer = RayTracer::create(posix_file_system(), scene.impl_->scene, below);
    if (!tracer.ok()) return public_error(tracer.error());
    return Tracer(std::make_unique<Impl>(scene.impl_, std::move(tracer).value()));
  });
}

Result<TraceReport> Tracer::trace(std::span<const Ray> rays, std::span<Hit> hits, Query query,
                                  const std::atomic<bool>* stop) {
  if (rays.size() != hits.size()) {
    return Error{ErrorCode::kUsage, std::to_string(rays.size()) + " rays, expected as many hits, found " +
                                        std::to_string(hits.size())};
  }
  if (rays.size() > RayTracer::kMostRays) {
    return Error{ErrorCode::kUsage, "a batch of " + std::to_string(rays.size()) + " rays: expected at most " +
                                        std::to_string(RayTracer::kMostRays)};
  }
  return within_memory<TraceReport>([&]() -> Result<TraceReport> {
    const std::lock_guard guard(impl_->mutex);
    BatchSource source(rays, hits, impl_->scene->scene.top_tree.moves());
    RenderHooks hooks;
    hooks.stop = stop;
    auto report = impl_->tracer->trace(source, rays.size(), query == Query::kAny ? RayQuery::kAny : RayQuery::kClosest,
                                       hooks);
    if (!report.ok()) return public_error(report.error());
    return public_report(report.value());
  });
}

uint64_t Tracer::cache_bytes() const { return impl_->tracer->plan().cache_bytes; }
uint64_t Tracer::rays_in_flight() const { return impl_->tracer->plan().paths_in_flight; }

}  // namespace shoal::api
