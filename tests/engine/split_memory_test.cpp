// How memory is split between rays in flight and page cache.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/split_memory.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
constexpr uint64_t kPathBytes = 240;

SplitInput input(uint64_t left_mib, uint64_t scene_mib, uint64_t most_paths) {
  SplitInput in;
  in.left_bytes = left_mib * kMiB;
  in.scene_page_bytes = scene_mib * kMiB;
  in.least_cache_bytes = 2 * kMiB;
  in.least_paths = 512;
  in.most_paths = most_paths;
  in.paths_bytes = [](uint64_t paths) { return kMiB + paths * kPathBytes; };
  return in;
}

TEST(SplitMemory, StaysWithinWhatIsLeftAndAboveTheLeast) {
  for (uint64_t left = 4; left < 4000; left = left * 5 / 4 + 1) {
    for (const uint64_t scene : {1u, 10u, 100u, 1000u, 100000u}) {
      for (const uint64_t most_paths : {1u, 600u, 100000u, 50000000u}) {
        SplitInput in = input(left, scene, most_paths);
        in.least_paths = std::min<uint64_t>(in.least_paths, most_paths);
        const uint64_t paths = choose_paths_in_flight(in);
        EXPECT_GE(paths, in.least_paths);
        EXPECT_LE(paths, std::max(in.least_paths, most_paths));
        EXPECT_LE(in.paths_bytes(paths) + in.least_cache_bytes, in.left_bytes)
            << left << " " << scene << " " << most_paths;
      }
    }
  }
}

TEST(SplitMemory, TakesAllSamplesOfASmallPictureWhenEverythingFits) {
  EXPECT_EQ(choose_paths_in_flight(input(1000, 100, 5000)), 5000u);
}

TEST(SplitMemory, ReadsLeastByItsModel) {
  // Between what half a million paths take (121 MiB) and half of what is left the model alone decides.
  for (uint64_t left = 400; left < 4000; left += 100) {
    for (uint64_t scene = left; scene < 3 * left; scene += 250) {
      const SplitInput in = input(left, scene, 1u << 30);
      const auto cost = [&](uint64_t paths) {
        const double b = static_cast<double>(in.paths_bytes(paths)), missing = static_cast<double>(scene - left) * kMiB;
        return (missing + b) * (missing + b) / b;
      };
      double least = cost(1u << 19);
      for (uint64_t paths = 1u << 19; in.paths_bytes(paths) <= in.left_bytes / 2; paths += 1u << 14) {
        least = std::min(least, cost(paths));
      }
      EXPECT_LE(cost(choose_paths_in_flight(in)), least * 1.001) << left << " of " << scene;
    }
  }
}

TEST(SplitMemory, GivesSceneOfManyTreeletsMorePaths) {
  SplitInput in = input(20000, 100, 1u << 30);
  EXPECT_EQ(choose_paths_in_flight(in), 1u << 19);
  in.treelet_count = 25000;
  EXPECT_EQ(choose_paths_in_flight(in), 2'000'000u);
}

TEST(SplitMemory, GivesPathsNoMoreThanHalf) {
  const SplitInput in = input(1000, 1000000, 1u << 30);
  const uint64_t paths = choose_paths_in_flight(in);
  EXPECT_LE(in.paths_bytes(paths), in.left_bytes / 2);
  EXPECT_GT(in.paths_bytes(paths + 1), in.left_bytes / 2);
}

}  // namespace
}  // namespace shoal
