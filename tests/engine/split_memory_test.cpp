// How memory is split between rays in flight and page cache.
#include <gtest/gtest.h>

#include "engine/split_memory.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
constexpr uint64_t kPathBytes = 240;

SplitInput input(uint64_t left_mib, uint64_t scene_mib, uint64_t samples) {
  SplitInput in;
  in.left_bytes = left_mib * kMiB;
  in.scene_page_bytes = scene_mib * kMiB;
  in.least_cache_bytes = 2 * kMiB;
  in.least_paths = 512;
  in.samples = samples;
  in.paths_bytes = [](uint64_t paths) { return kMiB + paths * kPathBytes; };
  return in;
}

TEST(SplitMemory, StaysWithinWhatIsLeftAndAboveTheLeast) {
  for (uint64_t left = 4; left < 4000; left = left * 5 / 4 + 1) {
    for (const uint64_t scene : {1u, 10u, 100u, 1000u, 100000u}) {
      for (const uint64_t samples : {1u, 600u, 100000u, 50000000u}) {
        SplitInput in = input(left, scene, samples);
        in.least_paths = std::min<uint64_t>(in.least_paths, samples);
        const uint64_t paths = choose_paths_in_flight(in);
        EXPECT_GE(paths, in.least_paths);
        EXPECT_LE(paths, std::max(in.least_paths, samples));
        EXPECT_LE(in.paths_bytes(paths) + in.least_cache_bytes, in.left_bytes) << left << " " << scene << " " << samples;
      }
    }
  }
}

TEST(SplitMemory, TakesAllSamplesOfASmallPictureWhenEverythingFits) {
  EXPECT_EQ(choose_paths_in_flight(input(1000, 100, 5000)), 5000u);
}

}  // namespace
}  // namespace shoal
