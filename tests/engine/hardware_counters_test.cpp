#include "engine/hardware_counters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/perf_event.h>

#include <cerrno>
#include <map>
#include <set>

namespace shoal {
namespace {

using ::testing::HasSubstr;

/// A kernel of our own: descriptors from 10 on, each with what is to be read.
struct FakePerf {
  struct Values {
    uint64_t value = 0, enabled = 100, running = 100;
  };
  std::set<uint32_t> refused_types;
  int refusal = ENOENT;
  std::map<int, Values> opened;
  int next = 10;

  PerfCalls calls() {
    return {[this](uint32_t type, uint64_t) {
              if (refused_types.contains(type)) return -refusal;
              opened[next] = {};
              return next++;
            },
            [this](int descriptor, uint64_t values[3]) {
              const Values& v = opened.at(descriptor);
              values[0] = v.value, values[1] = v.enabled, values[2] = v.running;
              return true;
            },
            [this](int descriptor) { EXPECT_EQ(opened.erase(descriptor), 1u); }};
  }
};

TEST(HardwareCounters, GiveWhatHappenedBetweenTwoReads) {
  FakePerf perf;
  {
    const HardwareCounters counters(perf.calls());
    EXPECT_TRUE(counters.available());
    EXPECT_EQ(counters.reason(), "");
    const HardwareCounts before = counters.read();
    for (auto& [descriptor, values] : perf.opened) values.value = 1000u * static_cast<unsigned>(descriptor);
    const HardwareCounts counts = difference(counters.read(), before);
    for (size_t i = 0; i < kHardwareCounterCount; ++i)
      EXPECT_EQ(counts[i], 1000 * (10 + i)) << kHardwareCounterNames[i];
  }
  EXPECT_TRUE(perf.opened.empty()) << "every descriptor is closed";
}

TEST(HardwareCounters, ScaleWhatTookTurns) {
  FakePerf perf;
  const HardwareCounters counters(perf.calls());
  perf.opened[10] = {600, 300, 100};
  perf.opened[11] = {5, 300, 0};  // never had its turn
  const HardwareCounts counts = counters.read();
  EXPECT_EQ(counts[0], 1800u);
  EXPECT_FALSE(counts[1].has_value());
}

TEST(HardwareCounters, SayWhyThereAreNone) {
  FakePerf perf;
  perf.refused_types = {PERF_TYPE_HARDWARE, PERF_TYPE_HW_CACHE};
  EXPECT_FALSE(HardwareCounters(perf.calls()).available());
  EXPECT_THAT(HardwareCounters(perf.calls()).reason(), HasSubstr("no such counter"));
  perf.refusal = EACCES;
  EXPECT_THAT(HardwareCounters(perf.calls()).reason(), HasSubstr("perf_event_paranoid"));
  perf.refusal = ENOSYS;
  EXPECT_THAT(HardwareCounters(perf.calls()).reason(), HasSubstr("perf_event_open"));
  for (const auto& count : HardwareCounters(perf.calls()).read()) EXPECT_FALSE(count.has_value());
}

TEST(HardwareCounters, NameThoseThatAreMissing) {
  FakePerf perf;
  perf.refused_types = {PERF_TYPE_HW_CACHE};
  const HardwareCounters counters(perf.calls());
  EXPECT_TRUE(counters.available());
  EXPECT_THAT(counters.reason(), HasSubstr("l1d_load_misses_count"));
  EXPECT_THAT(counters.reason(), HasSubstr("llc_load_misses_count"));
  EXPECT_THAT(counters.reason(), ::testing::Not(HasSubstr("cycles")));
  const HardwareCounts counts = difference(counters.read(), counters.read());
  EXPECT_TRUE(counts[static_cast<size_t>(HardwareCounter::cycles)].has_value());
  EXPECT_FALSE(counts[static_cast<size_t>(HardwareCounter::l1d_load_misses)].has_value());
}

/// Whatever this machine has: numbers, or a reason.
TEST(HardwareCounters, OfThisMachineAreThereOrSaidToBeAbsent) {
  const HardwareCounters counters;
  const HardwareCounts before = counters.read();
  volatile uint64_t sum = 0;
  for (uint64_t i = 0; i < 1'000'000; ++i) sum = sum + i;
  const HardwareCounts counts = difference(counters.read(), before);
  if (!counters.available()) {
    EXPECT_NE(counters.reason(), "");
    for (const auto& count : counts) EXPECT_FALSE(count.has_value());
  } else if (const auto& instructions = counts[static_cast<size_t>(HardwareCounter::instructions)]) {
    EXPECT_GT(*instructions, 1'000'000u);
  }
}

}  // namespace
}  // namespace shoal
