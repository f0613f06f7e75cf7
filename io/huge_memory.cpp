#include "io/huge_memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>

#include "io/aligned_buffer.h"

namespace shoal {
namespace {

constexpr uint64_t kHugePageBytes = 2u << 20;

}  // namespace

void UnmapMemory::operator()(std::byte* data) const { ::munmap(data, bytes); }

HugeMemory map_huge_memory(size_t bytes) {
  const size_t size = align_up(std::max<size_t>(bytes, 1), kBlockBytes);
  const size_t slack = size >= kHugePageBytes ? kHugePageBytes - kBlockBytes : 0;
  if (size < bytes || size + slack < size) throw std::bad_alloc();
  void* address = ::mmap(nullptr, size + slack, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (address == MAP_FAILED) throw std::bad_alloc();
  auto* mapped = static_cast<std::byte*>(address);
  auto* data = slack == 0 ? mapped
                          : mapped + (align_up(reinterpret_cast<uintptr_t>(mapped), kHugePageBytes) -
                                      reinterpret_cast<uintptr_t>(mapped));
  if (data > mapped) ::munmap(mapped, static_cast<size_t>(data - mapped));
  const size_t behind = slack - static_cast<size_t>(data - mapped);
  if (behind > 0) ::munmap(data + size, behind);
  // Whole large pages only: the rest of the last one would be memory that nobody charged. Systems without them refuse.
  if (const size_t whole = align_down(size, kHugePageBytes); whole > 0) (void)::madvise(data, whole, MADV_HUGEPAGE);
  return HugeMemory(data, UnmapMemory{size});
}

}  // namespace shoal
