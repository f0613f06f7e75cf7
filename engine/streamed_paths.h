// The paths that one thread has under way in an order whose rays come from a stream and go from start to end
// (hybrid, packet, packet-reorder, stream: engine/path_stream): their states and rays, and the pages that it has
// met, which it keeps. One a thread.
//
// Properties and assumptions
//   capacity   so many paths as are asked for, each with two rays at most.
//   pages      every page that was brought stays pinned: only where the cache has room for all.
#pragma once

#include <vector>

#include "engine/path_ray.h"
#include "engine/path_state.h"
#include "engine/render.h"
#include "io/huge_memory.h"
#include "io/page_cache.h"
#include "treelets/scene_traversal.h"

namespace shoal {

struct StreamedPaths {
  /// So many that camera rays, and the rays of one bounce after them, fill packets; few enough for the core's
  /// cache.
  static constexpr uint32_t kPaths = 1024;
  /// Order::kStream: so many that a stream fills from those that are home while none is under way.
  static constexpr uint32_t kStreamPaths = 2048;

  /// Of a thread.
  static uint32_t paths_of(Order order) { return order == Order::kStream ? kStreamPaths : kPaths; }

  StreamedPaths(size_t treelets, uint32_t path_count)
      : capacity(path_count), states(path_count), rays(2 * path_count), pins(treelets), pages(treelets, nullptr) {
    for (uint32_t path = path_count; path > 0;) free.push_back(--path);
    home.reserve(2 * path_count);
  }

  /// Of all threads, with their traversals. Requires: needs_every_page(order).
  static uint64_t bytes(Order order, size_t treelets, unsigned threads) {
    const uint64_t path = sizeof(PathState) + 2 * sizeof(Ray) + 6 * sizeof(uint32_t);
    return threads * (paths_of(order) * path + treelets * (sizeof(PagePin) + sizeof(const std::byte*)) +
                      traversal_bytes(order));
  }

  uint32_t capacity;  ///< paths
  HugeArray<PathState> states;
  HugeArray<Ray> rays;          ///< of path p: 2p the ray that goes on, 2p + 1 the shadow ray
  std::vector<uint32_t> free;   ///< paths
  std::vector<uint32_t> ready;  ///< rays to be traced, from `next_ready` on
  std::vector<uint32_t> home;   ///< rays whose answer is known
  size_t next_ready = 0;
  std::vector<PagePin> pins;  ///< by treelet
  std::vector<const std::byte*> pages;

 private:
  static uint64_t traversal_bytes(Order order) {
    if (order == Order::kStream) return stream_traversal_bytes();
    return order == Order::kHybrid ? SceneTracer::bytes() : packet_traversal_bytes();
  }
};

}  // namespace shoal
