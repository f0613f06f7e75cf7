// The orders of bench/memory_orders over again on one thread, with every byte they touch told to a TouchLog: rays and
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
                        std::span<RayAnswer> answers, TouchLog& log);

TraceCounts touch_queued_order(const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                               std::span<RayAnswer> answers, TouchLog& log);

/// Where a treelet's page begins.
inline const std::byte* page_touching(const MemoryScene& scene, TreeletId treelet, TouchLog& log) {
  log.read(scene.pages[treelet], TouchKind::kTopTree);
  return scene.pages[treelet].data();
}

inline Ray begin_touching(const RaySet& set, uint64_t index, TouchLog& log) {
  log.read(set.rays[index], TouchKind::kGivenRays);
  return begin_ray(set.rays[index], static_cast<uint32_t>(index), set.any_hit);
}

inline void answer_touching(const Ray& ray, std::span<RayAnswer> answers, TouchLog& log) {
  RayAnswer& answer = answers[ray.path & ~Ray::kAnyHitBit];
  answer = answer_of(ray);
  log.write(answer, TouchKind::kAnswers);
}

}  // namespace shoal::bench
