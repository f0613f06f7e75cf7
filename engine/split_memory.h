// How what is left of the cap is split between rays in flight and the page cache. A pure function of numbers, so that
// it can be tested and measured (bench/out_of_core split). Called by engine/memory_plan.
//
// The model: with M bytes left, S bytes of pages and paths that take b bytes, the cache holds f = (M - b) / S of the
// scene. Visits of treelets in the cache are served at once, so the rays in flight gather in the (1 - f) S that are not
// there, and a load serves rays in proportion to b / ((1 - f) S). Of all visits 1 - f need a load. So the bytes read,
// and the treelets taken in hand, go with
//
//     (1 - f)^2 S / b  ~  (S - M + b)^2 / b,
//
// which is least at b = S - M: paths take as much as is missing, but half of what is left at most. Beyond a half the
// model promises more, but it knows nothing of treelets that most rays want, and those must find room
// (docs/decisions/0012: what was measured).
//
// With room for all pages the paths are the useful ones only, max(2^19, 80 a treelet); else never fewer than that, unless
// those take more than half.
#pragma once

#include <cstdint>
#include <functional>

namespace shoal {

struct SplitInput {
  uint64_t left_bytes = 0;        ///< M: to be split
  uint64_t scene_page_bytes = 0;  ///< S: all pages decoded
  uint64_t treelet_count = 0;
  uint64_t least_cache_bytes = 0;
  uint64_t least_paths = 0;
  uint64_t most_paths = 0;        ///< samples of the whole picture, at most kMaxPathsInFlight
  std::function<uint64_t(uint64_t paths)> paths_bytes;  ///< b; grows with `paths`
};

/// The number of paths in flight. Requires: the least of both fit into left_bytes.
uint64_t choose_paths_in_flight(const SplitInput& input);

}  // namespace shoal
