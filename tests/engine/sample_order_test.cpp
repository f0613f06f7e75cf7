#include "engine/sample_order.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace shoal {
namespace {

TEST(SampleOrder, VisitsEverySampleOfEveryPixelOnce) {
  for (const auto& [width, height, samples] : {std::array{70u, 50u, 3u}, {1u, 1u, 5u}, {32u, 64u, 1u}, {33u, 1u, 2u}}) {
    const SampleOrder order(width, height, samples);
    std::vector<int> seen(width * height * samples);
    for (uint64_t index = 0; index < order.count(); ++index) {
      const PixelSample s = order.at(index);
      ASSERT_LT(s.x, width);
      ASSERT_LT(s.y, height);
      ASSERT_LT(s.sample, samples);
      ++seen[(s.y * width + s.x) * samples + s.sample];
    }
    for (const int times : seen) EXPECT_EQ(times, 1);
  }
}

}  // namespace
}  // namespace shoal
