// The one clock of renders and measurements. Called by engine and bench; any thread. Cost: a read of the clock.
#pragma once

#include <chrono>

namespace shoal {

/// Seconds of a monotonic clock: only differences mean anything.
inline double now_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace shoal
