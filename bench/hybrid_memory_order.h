// The hybrid order of bench/memory_orders, and what it shares with the bound: rays of a set through SceneTracer.
#pragma once

#include <functional>

#include "bench/memory_orders.h"
#include "treelets/trace_scene.h"

namespace shoal::bench {

/// Rays of a set: indices; `last` is not among them.
struct RayRange {
  uint64_t first = 0, last = 0;
};

/// One a thread.
class HybridTracer final : private RayStream {
 public:
  explicit HybridTracer(const MemoryScene& scene);
  HybridTracer(const HybridTracer&) = delete;
  HybridTracer& operator=(const HybridTracer&) = delete;
  /// Until `grab` gives an empty range.
  void trace(const RaySet& set, const std::function<RayRange()>& grab, std::span<RayAnswer> answers);
  const TraceCounts& counts() const { return counts_; }

 private:
  Ray* next() override;
  void done(Ray& ray, const RayWork& work) override;
  const std::byte* bring(TreeletId) override { return nullptr; }  // all are there

  /// Rays under way: those of packets that are being filled, and in hand.
  static constexpr uint32_t kSlots = 1024;

  std::vector<const std::byte*> pages_;
  HugeArray<Ray> rays_;
  uint32_t free_[kSlots], free_count_ = kSlots;
  SceneTracer tracer_;
  TraceCounters counters_;
  TraceCounts counts_;
  const RaySet* set_ = nullptr;
  const std::function<RayRange()>* grab_ = nullptr;
  std::span<RayAnswer> answers_;
  RayRange range_;
};

std::unique_ptr<RayOrder> make_hybrid_order(const MemoryScene& scene, unsigned threads);

}  // namespace shoal::bench
