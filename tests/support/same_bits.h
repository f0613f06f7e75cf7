// Floats compared as they lie in memory: -0 is not 0, and a NaN is itself.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

namespace shoal::testing {

inline bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](float x, float y) { return std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(y); });
}

}  // namespace shoal::testing
