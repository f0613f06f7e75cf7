// The clocks of renders and measurements. Called by engine and bench; any thread. Cost: a read of the clock.
#pragma once

#include <chrono>
#include <ctime>

namespace shoal {

/// Seconds of a monotonic clock: only differences mean anything.
inline double now_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Processor time of all threads of the process, in seconds.
inline double process_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace shoal
