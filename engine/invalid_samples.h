// Numbers of paths that are not finite: how many, of which term, and where the first was. What is not finite is dropped
// before it is added to anything. Called by engine/shade and engine/render_worker; the sums go to engine/counters. Plain
// values: one set a thread. Cost: nothing for numbers that are finite.
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <string_view>

#include "engine/path_state.h"

namespace shoal {

enum class InvalidTerm : uint8_t { kEmission, kEnvironment, kLight, kSurface, kBounce, kPath };
inline constexpr std::array<std::string_view, 6> kInvalidTermNames{"emission", "environment", "light sample",
                                                                   "surface",  "bounce",      "sum of a path"};

struct InvalidPlace {
  uint32_t pixel = kNoIndex;  ///< kNoIndex: there is none
  uint32_t sample = 0, bounce = 0;
  InvalidTerm term = InvalidTerm::kEmission;

  auto operator<=>(const InvalidPlace&) const = default;
};

struct InvalidSamples {
  std::array<uint64_t, kInvalidTermNames.size()> counts{};
  InvalidPlace first;  ///< the least: whatever the order of a render, the same

  void add(InvalidTerm term, const PathState& path) {
    ++counts[static_cast<size_t>(term)];
    first = std::min(first, InvalidPlace{path.pixel, path.sample, path.bounce, term});
  }
  uint64_t of(InvalidTerm term) const { return counts[static_cast<size_t>(term)]; }
  uint64_t total() const {
    uint64_t sum = 0;
    for (const uint64_t count : counts) sum += count;
    return sum;
  }
};

}  // namespace shoal
