#include "engine/split_memory.h"

#include <algorithm>

namespace shoal {
namespace {

/// With fewer paths batches are so small that taking a treelet in hand costs more than tracing its rays, wherever the
/// pages are: 80 a treelet, and half a million in any scene. Measured (docs/decisions/0012): with 27 a treelet 2.3 times
/// the time, with 7 seven times; more than 80 were not seen to pay in memory.
constexpr uint64_t kUsefulPaths = 1u << 19, kUsefulPathsATreelet = 80;

/// The most paths, from `least` to `most`, that take no more than `bytes`; `least` if none does.
uint64_t paths_within(const SplitInput& in, uint64_t least, uint64_t most, uint64_t bytes) {
  while (least < most) {
    const uint64_t middle = least + (most - least + 1) / 2;
    if (in.paths_bytes(middle) <= bytes) {
      least = middle;
    } else {
      most = middle - 1;
    }
  }
  return least;
}

}  // namespace

uint64_t choose_paths_in_flight(const SplitInput& in) {
  const uint64_t most = std::max(in.least_paths, in.most_paths);
  const uint64_t useful = std::clamp(std::max(kUsefulPaths, kUsefulPathsATreelet * in.treelet_count),
                                     in.least_paths, most);
  const uint64_t useful_bytes = in.paths_bytes(useful);
  if (in.scene_page_bytes + useful_bytes <= in.left_bytes) return useful;
  const uint64_t missing = in.scene_page_bytes > in.left_bytes ? in.scene_page_bytes - in.left_bytes : 0;
  const uint64_t share = std::min({std::max(missing, useful_bytes), in.left_bytes / 2,
                                   in.left_bytes - in.least_cache_bytes});
  return paths_within(in, in.least_paths, most, share);
}

}  // namespace shoal
