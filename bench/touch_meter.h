// What the re-enacted orders (bench/touched_orders) touch goes from their log into a model of the caches. One
// thread.
#pragma once

#include "engine/cache_model.h"
#include "treelets/touch_log.h"

namespace shoal::bench {

/// The kinds that orders in memory touch: the first of TouchKind, by shorter names.
inline constexpr const char* kDataKinds[] = {"top tree", "nodes",  "leaves",  "rays",
                                             "answers",  "queues", "sorting", "in hand"};
inline constexpr uint8_t kDataKindCount = std::size(kDataKinds);
static_assert(kDataKindCount == static_cast<uint8_t>(TouchKind::kInHand) + 1);

class ModelSink final : public TouchSink {
 public:
  /// Keeps a reference. Without `prefetches` what the kernels ask for ahead of time is not told.
  ModelSink(CacheModel& model, bool prefetches) : model_(model), prefetches_(prefetches) {}

  void take(std::span<const Touch> touches) override {
    for (const Touch& touch : touches) {
      if (touch.action == TouchAction::kPrefetch && !prefetches_) continue;
      model_.touch(touch.address, touch.bytes, touch.action == TouchAction::kWrite,
                   static_cast<uint8_t>(touch.kind));
    }
  }

 private:
  CacheModel& model_;
  bool prefetches_;
};

}  // namespace shoal::bench
