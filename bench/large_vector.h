// A std::vector on large pages (io/huge_memory.h): for arrays that some order of rays reads or writes all over, so that
// no program pays for address translation that another is spared. Called by bench only; for megabytes and more.
#pragma once

#include <algorithm>
#include <vector>

#include "io/aligned_buffer.h"
#include "io/huge_memory.h"

namespace shoal::bench {

template <class T>
struct LargePages {
  using value_type = T;

  LargePages() = default;
  template <class U>
  LargePages(const LargePages<U>&) {}

  T* allocate(size_t count) { return reinterpret_cast<T*>(map_huge_memory(count * sizeof(T)).release()); }
  void deallocate(T* data, size_t count) {
    UnmapMemory{align_up(std::max<size_t>(count * sizeof(T), 1), kBlockBytes)}(reinterpret_cast<std::byte*>(data));
  }
  bool operator==(const LargePages&) const { return true; }
};

template <class T>
using LargeVector = std::vector<T, LargePages<T>>;

}  // namespace shoal::bench
