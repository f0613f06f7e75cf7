// What a render is asked to do about checkpoints (docs/checkpoints.md). Called by bins and engine/render. Plain values.
#pragma once

#include <cstdint>
#include <string>

namespace shoal {

struct CheckpointOptions {
  std::string path;          ///< where it is written, and read; empty: neither
  double every_seconds = 0;  ///< from the end of one to the beginning of the next; 0: only when the render is stopped
  bool resume = false;       ///< goes on from what is at `path`. Requires: there is one
  uint64_t unfinished_count = 0;  ///< unfinished_in() of that, for the memory plan; 0 without
};

/// What a render found done when it went on from a checkpoint.
struct ResumedFrom {
  uint64_t samples = 0;  ///< of all pixels together
  double seconds = 0;    ///< of rendering
};

}  // namespace shoal
