// The orders of bench/memory_orders over again on one thread, with every byte they touch told to a TouchMeter: rays and
// answers, keys and permutations of the sort, queues and their blocks, what is in hand, and the scene. The same rays
// meet in the same order, so answers, tests, visits and drains are those of make_order() with one thread; who
// calls this checks that they are. Called by bench/cache_traffic. Cost: some ten times that of the order.
#pragma once

#include "bench/memory_orders.h"
#include "bench/touched_group.h"

namespace shoal::bench {

/// Requires: options.threads == 1, a scene of one instance whose space is the world, as many answers as rays, and
/// fewer rays than RaySorter::kMaxSlots.
TraceCounts touch_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                        std::span<RayAnswer> answers, TouchMeter& meter);

TraceCounts touch_queued_order(const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                               std::span<RayAnswer> answers, TouchMeter& meter);

/// Where a treelet's page begins.
inline const std::byte* page_touching(const MemoryScene& scene, TreeletId treelet, TouchMeter& meter) {
  meter.read(scene.pages[treelet], DataKind::kTopTree);
  return scene.pages[treelet].data();
}

inline Ray begin_touching(const RaySet& set, uint64_t index, TouchMeter& meter) {
  meter.read(set.rays[index], DataKind::kRays);
  return begin_ray(set.rays[index], static_cast<uint32_t>(index), set.any_hit);
}

inline void answer_touching(const Ray& ray, std::span<RayAnswer> answers, TouchMeter& meter) {
  RayAnswer& answer = answers[ray.path & ~Ray::kAnyHitBit];
  answer = answer_of(ray);
  meter.write(answer, DataKind::kAnswers);
}

}  // namespace shoal::bench
