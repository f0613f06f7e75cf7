// How what is left of the cap is split between rays in flight and the page cache. A pure function of numbers, so that
// it can be tested and measured (bench/out_of_core split). Called by engine/memory_plan.
#pragma once

#include <cstdint>
#include <functional>

namespace shoal {

struct SplitInput {
  uint64_t left_bytes = 0;        ///< to be split
  uint64_t scene_page_bytes = 0;  ///< all pages decoded
  uint64_t least_cache_bytes = 0;
  uint64_t least_paths = 0;
  uint64_t samples = 0;           ///< of the whole picture: more paths than these never exist
  std::function<uint64_t(uint64_t paths)> paths_bytes;  ///< grows with `paths`
};

/// The number of paths in flight. Requires: the least of both fit into left_bytes.
uint64_t choose_paths_in_flight(const SplitInput& input);

}  // namespace shoal
