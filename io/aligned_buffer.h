// Scratch memory aligned for direct reads and writes (O_DIRECT): contents are not kept when it grows. Used by the
// file layer and the page file, one a thread or one a writer. Thread rule: one thread. Cost: none until it grows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>

#include "io/result.h"

namespace shoal {

/// Direct I/O wants addresses, offsets and sizes in multiples of the device's block: 512 or 4096 bytes.
inline constexpr uint64_t kBlockBytes = 4096;

/// Requires: value <= 2^64 - alignment, alignment a power of two.
constexpr uint64_t align_up(uint64_t value, uint64_t alignment) {
  return (value + alignment - 1) & ~(alignment - 1);
}
constexpr uint64_t align_down(uint64_t value, uint64_t alignment) { return value & ~(alignment - 1); }

class AlignedBuffer {
 public:
  /// At least `bytes` bytes, aligned to kBlockBytes. Fails with: kMemoryCap.
  Result<std::span<std::byte>> reserve(uint64_t bytes) {
    if (bytes > capacity_bytes_) {
      const uint64_t rounded = align_up(bytes, kBlockBytes);
      memory_.reset();
      capacity_bytes_ = 0;
      memory_.reset(static_cast<std::byte*>(std::aligned_alloc(kBlockBytes, rounded)));
      if (!memory_)
        return Error{ErrorCode::kMemoryCap, "no memory for a buffer of " + std::to_string(rounded) + " bytes"};
      capacity_bytes_ = rounded;
    }
    return std::span<std::byte>(memory_.get(), bytes);
  }
  /// Gives the memory back when it holds more than `limit_bytes`.
  void shrink(uint64_t limit_bytes) {
    if (capacity_bytes_ <= limit_bytes) return;
    memory_.reset();
    capacity_bytes_ = 0;
  }

 private:
  struct Free {
    void operator()(std::byte* p) const { std::free(p); }
  };
  std::unique_ptr<std::byte, Free> memory_;
  uint64_t capacity_bytes_ = 0;
};

}  // namespace shoal
