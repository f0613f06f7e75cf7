// What every fuzz target is: one function that takes any bytes, and that libFuzzer (scripts/fuzz) or
// tests/fuzz/replay.cpp calls. It may refuse its input, and must not crash, leak, loop or break a promise of the
// code under test. Thread rule: one thread. docs/fuzzing.md says how to run them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/result.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace shoal::fuzz {

/// Pictures of more pixels are refused: a budget, as `image_pixels` is for users, small enough that inputs stay
/// quick.
inline constexpr uint64_t kMaxPixels = 1u << 20;

inline std::vector<std::byte> bytes_of(const uint8_t* data, size_t size) {
  const auto* begin = reinterpret_cast<const std::byte*>(data);
  return {begin, begin + size};
}

/// A promise of the code under test.
inline void require(bool promise) { SHOAL_CHECK(promise); }

}  // namespace shoal::fuzz
