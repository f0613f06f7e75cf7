// The processor's own counters (cycles, instructions, misses of caches and branches) around a piece of work, by
// Linux's perf_event_open: of this process, user mode only, with the threads that it starts. Where the machine or
// the system has none (virtual machines, containers, perf_event_paranoid) it says why. Called by bins.
//
// Properties and assumptions
//   threads    counts the thread that made it and all that are started afterwards by counted ones: made before the
//              first thread is. read() by one thread.
//   sharing    where the processor has fewer counters than are asked for, the kernel lets them take turns, and
//   counts are
//              scaled by the share of the time that each ran.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace shoal {

// X(name, sentence): as `perf stat -e` names them, with underscores.
#define SHOAL_HARDWARE_COUNTERS(X)                        \
  X(cycles, "cycles of the processor")                    \
  X(instructions, "instructions")                         \
  X(l1d_load_misses, "loads that missed the first level") \
  X(llc_load_misses, "loads that missed the last level")  \
  X(branch_misses, "branches guessed wrong")

enum class HardwareCounter : uint8_t {
#define SHOAL_DECLARE(name, sentence) name,
  SHOAL_HARDWARE_COUNTERS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};
inline constexpr const char* kHardwareCounterNames[] = {
#define SHOAL_DECLARE(name, sentence) #name "_count",
    SHOAL_HARDWARE_COUNTERS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};
inline constexpr size_t kHardwareCounterCount = std::size(kHardwareCounterNames);

/// Since the counters were made, or between two of these; none: this machine does not have it.
using HardwareCounts = std::array<std::optional<uint64_t>, kHardwareCounterCount>;

HardwareCounts difference(const HardwareCounts& after, const HardwareCounts& before);

/// The system calls behind, so that tests can put others in their place.
struct PerfCalls {
  /// perf_event_open of this process for a type and a config of <linux/perf_event.h>: a descriptor, or -errno.
  std::function<int(uint32_t type, uint64_t config)> open;
  /// Value, time enabled, time running; false: it failed.
  std::function<bool(int descriptor, uint64_t values[3])> read;
  std::function<void(int descriptor)> close;
};
PerfCalls system_perf_calls();

class HardwareCounters {
 public:
  /// Begins to count what can be counted.
  explicit HardwareCounters(PerfCalls calls = system_perf_calls());
  ~HardwareCounters();
  HardwareCounters(const HardwareCounters&) = delete;
  HardwareCounters& operator=(const HardwareCounters&) = delete;

  /// Whether there is any.
  bool available() const;
  /// Why there is none, or why some are missing; empty: all are there.
  const std::string& reason() const { return reason_; }
  HardwareCounts read() const;

 private:
  PerfCalls calls_;
  std::array<int, kHardwareCounterCount> descriptors_;
  std::string reason_;
};

}  // namespace shoal
