// The paths that one thread has under way in the hybrid order (engine/render_hybrid): their states and rays, and the
// pages that it has met, which it keeps. One a thread.
//
// Properties and assumptions
//   capacity   kPaths paths, each with two rays at most.
//   pages      every page that was brought stays pinned: only where the cache has room for all.
#pragma once

#include <vector>

#include "engine/path_ray.h"
#include "engine/path_state.h"
#include "io/huge_memory.h"
#include "io/page_cache.h"
#include "treelets/trace_scene.h"

namespace shoal {

struct HybridPaths {
  /// So many that camera rays, and the rays of one bounce after them, fill packets; few enough for the core's cache.
  static constexpr uint32_t kPaths = 1024;

  explicit HybridPaths(size_t treelets)
      : states(kPaths), rays(2 * kPaths), pins(treelets), pages(treelets, nullptr) {
    for (uint32_t path = kPaths; path > 0;) free.push_back(--path);
    home.reserve(2 * kPaths);
  }

  /// Of all threads.
  static uint64_t bytes(size_t treelets, unsigned threads) {
    const uint64_t path = sizeof(PathState) + 2 * sizeof(Ray) + 6 * sizeof(uint32_t);
    return threads * (kPaths * path + treelets * (sizeof(PagePin) + sizeof(const std::byte*)) + SceneTracer::bytes());
  }

  HugeArray<PathState> states;
  HugeArray<Ray> rays;                ///< of path p: 2p the ray that goes on, 2p + 1 the shadow ray
  std::vector<uint32_t> free;         ///< paths
  std::vector<uint32_t> ready;        ///< rays to be traced, from `next_ready` on
  std::vector<uint32_t> home;         ///< rays whose answer is known
  size_t next_ready = 0;
  std::vector<PagePin> pins;          ///< by treelet
  std::vector<const std::byte*> pages;
};

}  // namespace shoal
