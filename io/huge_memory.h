// Large arrays that are touched all over, one place after another far away: on large pages of 2 MiB where the system
// has them, so that most touches find their address translation. Used by queues/ray_block_pool,
// queues/path_lists and engine/queued_paths.
//
// Properties and assumptions
//   memory     not touched before it is used: it becomes resident piece by piece, 2 MiB at once at most, and never
//              more than the array's size rounded up to 4 KiB.
//   threads    none of its own; as an array.
//   cost       a few system calls to make it; then a page fault for 2 MiB, at first touch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

namespace shoal {

struct UnmapMemory {
  size_t bytes = 0;
  void operator()(std::byte* data) const;
};
using HugeMemory = std::unique_ptr<std::byte, UnmapMemory>;

/// Zeroed memory, aligned to 4 KiB at least and to 2 MiB if as large. Throws std::bad_alloc.
HugeMemory map_huge_memory(size_t bytes);

/// `count` elements of zero bytes: whoever uses one first gives it its value.
template <class T>
class HugeArray {
  static_assert(std::is_trivially_destructible_v<T> && alignof(T) <= 4096);

 public:
  explicit HugeArray(size_t count) : memory_(map_huge_memory(count * sizeof(T))) {}
  T* data() const { return reinterpret_cast<T*>(memory_.get()); }
  T& operator[](size_t index) const { return data()[index]; }

 private:
  HugeMemory memory_;
};

}  // namespace shoal
