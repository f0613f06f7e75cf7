// Tells a cache model which bytes of which data tracing touches. Held by what re-enacts the kernels and the orders
// (bench/touched_kernels, bench/touched_orders). One thread. Cost: that of the model.
#pragma once

#include "bench/cache_model.h"

namespace shoal::bench {

enum class DataKind : uint8_t {
  kTopTree,  ///< nodes, entries, instances, and where each treelet's page begins
  kNodes,    ///< of treelets, with their headers
  kLeaves,
  kRays,     ///< as they are given
  kAnswers,  ///< as they are handed back
  kQueues,   ///< blocks of waiting rays, and what stands about them in tables
  kSorting,  ///< keys and permutations
  kInHand,   ///< of the rays being traced: themselves, their contexts and stacks
};
inline constexpr const char* kDataKinds[] = {"top tree", "nodes",  "leaves",  "rays",
                                             "answers",  "queues", "sorting", "in hand"};
inline constexpr uint8_t kDataKindCount = std::size(kDataKinds);
static_assert(kDataKindCount == static_cast<uint8_t>(DataKind::kInHand) + 1);

class TouchMeter {
 public:
  /// Keeps a reference. Without `prefetches` what the kernels ask for ahead of time is not told.
  TouchMeter(CacheModel& model, bool prefetches) : model_(model), prefetches_(prefetches) {}

  void read(const void* at, size_t bytes, DataKind kind) { touch(at, bytes, false, kind); }
  void write(const void* at, size_t bytes, DataKind kind) { touch(at, bytes, true, kind); }
  template <class T>
  void read(const T& value, DataKind kind) {
    read(&value, sizeof(T), kind);
  }
  template <class T>
  void write(const T& value, DataKind kind) {
    write(&value, sizeof(T), kind);
  }
  /// The line that `at` lies in.
  void prefetch(const void* at, DataKind kind) {
    if (prefetches_) touch(at, 1, false, kind);
  }

 private:
  void touch(const void* at, size_t bytes, bool write, DataKind kind) {
    model_.touch(reinterpret_cast<uintptr_t>(at), bytes, write, static_cast<uint8_t>(kind));
  }

  CacheModel& model_;
  bool prefetches_;
};

}  // namespace shoal::bench
