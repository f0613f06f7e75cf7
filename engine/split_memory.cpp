#include "engine/split_memory.h"

#include <algorithm>

namespace shoal {
namespace {

/// Paths beyond this many in flight were not seen to pay in memory; out of core the share below decides.
constexpr uint64_t kDefaultPaths = 1u << 19;
/// Of what is left, the part that rays in flight may take when pages do not all fit: chosen, not yet measured.
constexpr double kPathShare = 0.25;

}  // namespace

uint64_t choose_paths_in_flight(const SplitInput& in) {
  uint64_t paths = std::max(in.least_paths, std::min(kDefaultPaths, in.samples));
  if (in.scene_page_bytes + in.paths_bytes(paths) <= in.left_bytes) return paths;
  const uint64_t share = std::min<uint64_t>(static_cast<uint64_t>(kPathShare * static_cast<double>(in.left_bytes)),
                                            in.left_bytes - in.least_cache_bytes);
  while (paths > in.least_paths && in.paths_bytes(paths) > share) paths = std::max(in.least_paths, paths * 7 / 8);
  return paths;
}

}  // namespace shoal
