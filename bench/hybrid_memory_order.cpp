// The hybrid order in memory: rays in the order given, in packets while they agree and one by one where they do not, by
// the kernels of engine/render_hybrid (treelets/trace_scene).
#include "bench/hybrid_memory_order.h"

#include <atomic>
#include <mutex>

namespace shoal::bench {
namespace {

/// Rays of one grab: packets are filled from them, apart for each direction.
constexpr uint64_t kHybridGrab = 4 * kRaysPerGrab;

class HybridOrder : public RayOrder {
 public:
  HybridOrder(const MemoryScene& scene, unsigned threads) : scene_(scene), threads_(threads) {}

  OrderRun run(const RaySet& set, std::span<RayAnswer> answers) override {
    std::atomic<uint64_t> next{0};
    std::mutex mutex;
    OrderRun result;
    result.seconds = run_together(threads_, [&](unsigned) {
      const auto tracer = std::make_unique<HybridTracer>(scene_);
      const auto grab = [&] {
        const uint64_t first = next.fetch_add(kHybridGrab);
        return RayRange{std::min<uint64_t>(first, set.rays.size()),
                        std::min<uint64_t>(first + kHybridGrab, set.rays.size())};
      };
      tracer->trace(set, grab, answers);
      const std::lock_guard guard(mutex);
      result.counts.add(tracer->counts());
    });
    return result;
  }

 private:
  const MemoryScene& scene_;
  unsigned threads_;
};

}  // namespace

HybridTracer::HybridTracer(const MemoryScene& scene)
    : pages_(scene.pages.size()), rays_(kSlots), tracer_(scene.top_tree(), pages_.data()) {
  for (size_t i = 0; i < pages_.size(); ++i) pages_[i] = scene.pages[i].data();
  for (uint32_t slot = 0; slot < kSlots; ++slot) free_[slot] = slot;
}

void HybridTracer::trace(const RaySet& set, const std::function<RayRange()>& grab, std::span<RayAnswer> answers) {
  set_ = &set, grab_ = &grab, answers_ = answers;
  range_ = {};
  free_count_ = kSlots;
  tracer_.trace(*this, counters_);
}

Ray* HybridTracer::next() {
  if (free_count_ == 0) return nullptr;
  if (range_.first == range_.last) range_ = (*grab_)();
  if (range_.first == range_.last) return nullptr;
  Ray& ray = rays_[free_[--free_count_]];
  ray = begin_ray(set_->rays[range_.first], static_cast<uint32_t>(range_.first), set_->any_hit);
  ++range_.first;
  return &ray;
}

void HybridTracer::done(Ray& ray, const RayWork& work) {
  counts_.node_tests += work.node_tests, counts_.triangle_tests += work.triangle_tests;
  counts_.treelet_visits += work.treelets;
  answers_[ray.path & ~Ray::kAnyHitBit] = answer_of(ray);
  free_[free_count_++] = static_cast<uint32_t>(&ray - rays_.data());
}

std::unique_ptr<RayOrder> make_hybrid_order(const MemoryScene& scene, unsigned threads) {
  return std::make_unique<HybridOrder>(scene, threads);
}

}  // namespace shoal::bench
