#include "engine/hardware_counters.h"

#include <fmt/format.h>
#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <tuple>

namespace shoal {
namespace {

struct Event {
  uint32_t type;
  uint64_t config;
};

constexpr uint64_t cache_event(uint64_t cache, uint64_t operation, uint64_t result) {
  return cache | operation << 8 | result << 16;
}

constexpr Event kEvents[] = {
    {PERF_TYPE_HARDWARE, PERF_COUNT_HW_CPU_CYCLES},
    {PERF_TYPE_HARDWARE, PERF_COUNT_HW_INSTRUCTIONS},
    {PERF_TYPE_HW_CACHE,
     cache_event(PERF_COUNT_HW_CACHE_L1D, PERF_COUNT_HW_CACHE_OP_READ, PERF_COUNT_HW_CACHE_RESULT_MISS)},
    {PERF_TYPE_HW_CACHE,
     cache_event(PERF_COUNT_HW_CACHE_LL, PERF_COUNT_HW_CACHE_OP_READ, PERF_COUNT_HW_CACHE_RESULT_MISS)},
    {PERF_TYPE_HARDWARE, PERF_COUNT_HW_BRANCH_MISSES},
};
static_assert(std::size(kEvents) == kHardwareCounterCount);

int open_event(uint32_t type, uint64_t config) {
  perf_event_attr attr{};
  attr.size = sizeof attr;
  attr.type = type;
  attr.config = config;
  attr.inherit = 1;
  attr.exclude_kernel = 1;
  attr.exclude_hv = 1;
  attr.read_format = PERF_FORMAT_TOTAL_TIME_ENABLED | PERF_FORMAT_TOTAL_TIME_RUNNING;
  const long descriptor = syscall(SYS_perf_event_open, &attr, 0, -1, -1, PERF_FLAG_FD_CLOEXEC);
  return descriptor >= 0 ? static_cast<int>(descriptor) : -errno;
}

/// What an errno of perf_event_open says to people.
std::string meaning(int code) {
  switch (code) {
    case ENOENT:
    case ENODEV:
    case EOPNOTSUPP:
      return "the machine has no such counter";
    case EACCES:
    case EPERM:
      return "not permitted: see /proc/sys/kernel/perf_event_paranoid";
    case ENOSYS:
      return "the system has no perf_event_open";
    default:
      return std::strerror(code);
  }
}

}  // namespace

HardwareCounts difference(const HardwareCounts& after, const HardwareCounts& before) {
  HardwareCounts counts;
  for (size_t i = 0; i < counts.size(); ++i) {
    // Scaled counts of counters that take turns can run backwards by a little.
    if (after[i] && before[i]) counts[i] = *after[i] > *before[i] ? *after[i] - *before[i] : 0;
  }
  return counts;
}

PerfCalls system_perf_calls() {
  return {open_event,
          [](int descriptor, uint64_t values[3]) {
            return read(descriptor, values, 3 * sizeof(uint64_t)) == static_cast<ssize_t>(3 * sizeof(uint64_t));
          },
          [](int descriptor) { close(descriptor); }};
}

HardwareCounters::HardwareCounters(PerfCalls calls) : calls_(std::move(calls)) {
  for (size_t i = 0; i < kHardwareCounterCount; ++i) {
    descriptors_[i] = calls_.open(kEvents[i].type, kEvents[i].config);
    if (descriptors_[i] >= 0) continue;
    const std::string name(kHardwareCounterNames[i]);
    reason_ += fmt::format("{}{}: {}", reason_.empty() ? "" : "; ", name, meaning(-descriptors_[i]));
  }
  if (!available()) reason_ = meaning(-descriptors_[0]);
}

HardwareCounters::~HardwareCounters() {
  for (const int descriptor : descriptors_) {
    if (descriptor >= 0) calls_.close(descriptor);
  }
}

bool HardwareCounters::available() const {
  for (const int descriptor : descriptors_) {
    if (descriptor >= 0) return true;
  }
  return false;
}

HardwareCounts HardwareCounters::read() const {
  HardwareCounts counts;
  for (size_t i = 0; i < counts.size(); ++i) {
    uint64_t values[3] = {};
    if (descriptors_[i] < 0 || !calls_.read(descriptors_[i], values)) continue;
    const auto [value, enabled, running] = std::tuple(values[0], values[1], values[2]);
    if (running == 0) {
      if (enabled == 0) counts[i] = value;  // else it never had its turn
      continue;
    }
    const double share = static_cast<double>(enabled) / static_cast<double>(running);
    counts[i] = running >= enabled ? value : static_cast<uint64_t>(static_cast<double>(value) * share);
  }
  return counts;
}

}  // namespace shoal
