// Rays that can be told apart, and what a queue holds of them. Used by tests/queues.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "queues/treelet_queues.h"

namespace shoal::testing {

inline Ray numbered_ray(uint32_t number) {
  Ray ray;
  ray.path = number;
  ray.t = static_cast<float>(number);
  return ray;
}

/// Takes all rays of a treelet; their numbers in order.
inline std::vector<uint32_t> drain(TreeletQueues& queues, TreeletId treelet) {
  std::vector<uint32_t> numbers;
  RayBatch batch = queues.take(treelet);
  RayBlock block;
  while (const uint32_t count = batch.next_block(block)) {
    for (uint32_t i = 0; i < count; ++i) {
      EXPECT_EQ(block.rays[i].t, static_cast<float>(block.rays[i].path));
      numbers.push_back(block.rays[i].path);
    }
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace shoal::testing
