// A clock that is cheap enough to ask at every change of work: ticks of a length that only who counts them finds out,
// beside a clock of seconds over the same time. Called by io/page_cache and engine/phase_clock; any thread.
// Cost: about 25 cycles on x86-64 (the time stamp counter), a read of the system's clock elsewhere.
//
// Assumes, on x86-64, a counter that runs at one rate and alike on all cores, as those of the last fifteen years do.
// Where it does not, times are shares of a wrong whole; nothing else depends on it.
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <x86intrin.h>
#else
#include <chrono>
#endif

namespace shoal {

/// Only differences mean anything.
inline uint64_t now_ticks() {
#if defined(__x86_64__)
  return __rdtsc();
#else
  return static_cast<uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

}  // namespace shoal
