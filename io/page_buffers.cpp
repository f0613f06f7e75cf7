#include "io/page_buffers.h"

#include <fmt/core.h>
#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "io/aligned_buffer.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#define SHOAL_POISON(address, size) __asan_poison_memory_region(address, size)
#define SHOAL_UNPOISON(address, size) __asan_unpoison_memory_region(address, size)
#else
#define SHOAL_POISON(address, size) ((void)(address))
#define SHOAL_UNPOISON(address, size) ((void)(address))
#endif

namespace shoal {
namespace {

constexpr uint64_t kMappingBytes = 64u << 20;

uint64_t extent_bytes(unsigned size_class) { return kBlockBytes << size_class; }

void forget_memory(std::byte* data, uint64_t bytes) {
  // Refused only for locked memory, which then stays: its bytes must read as zero all the same.
  if (bytes > 0 && ::madvise(data, bytes, MADV_DONTNEED) != 0) std::memset(data, 0, bytes);
}

}  // namespace

PageBuffers::~PageBuffers() {
  for (const Mapping& mapping : mappings_) {
    SHOAL_UNPOISON(mapping.data, mapping.bytes);
    ::munmap(mapping.data, mapping.bytes);
  }
}

uint64_t PageBuffers::charge_bytes(uint32_t page_bytes) {
  return align_up(std::max<uint64_t>(page_bytes, 1), kBlockBytes);
}

unsigned PageBuffers::class_of(uint32_t page_bytes) {
  const uint64_t blocks = align_up(uint64_t{page_bytes} + kPageTailBytes, kBlockBytes) / kBlockBytes;
  return static_cast<unsigned>(std::countr_zero(std::bit_ceil(blocks)));
}

uint64_t PageBuffers::reusable_bytes(uint32_t page_bytes) const {
  const auto& kept = kept_[class_of(page_bytes)];
  return kept.empty() ? 0 : kept.back().charge_bytes;
}

Result<std::byte*> PageBuffers::take(uint32_t page_bytes) {
  const unsigned size_class = class_of(page_bytes);
  std::byte* data = nullptr;
  if (auto& kept = kept_[size_class]; !kept.empty()) {
    const Kept taken = kept.back();
    kept.pop_back();
    kept_bytes_ -= taken.charge_bytes;
    data = taken.data;
    const uint64_t charge = charge_bytes(page_bytes);
    if (taken.charge_bytes > charge) {
      SHOAL_UNPOISON(data, extent_bytes(size_class));
      forget_memory(data + charge, taken.charge_bytes - charge);
    }
  } else if (auto& untouched = untouched_[size_class]; !untouched.empty()) {
    data = untouched.back();
    untouched.pop_back();
  } else {
    SHOAL_ASSIGN_OR_RETURN(data, new_extent(extent_bytes(size_class)));
  }
  SHOAL_POISON(data, extent_bytes(size_class));
  SHOAL_UNPOISON(data, page_bytes + kPageTailBytes);
  return data;
}

void PageBuffers::zero_tail(std::byte* data, uint32_t page_bytes) {
  const uint64_t touched = charge_bytes(page_bytes);
  std::memset(data + page_bytes, 0, std::min<uint64_t>(kPageTailBytes, touched - page_bytes));
}

void PageBuffers::keep(std::byte* data, uint32_t page_bytes) {
  const unsigned size_class = class_of(page_bytes);
  SHOAL_POISON(data, extent_bytes(size_class));
  kept_[size_class].push_back({data, charge_bytes(page_bytes)});
  kept_bytes_ += charge_bytes(page_bytes);
}

void PageBuffers::release_other(uint32_t page_bytes) {
  const unsigned spared = class_of(page_bytes);
  for (unsigned size_class = 0; size_class < kClassCount; ++size_class) {
    const size_t keep_count = size_class == spared ? 1 : 0;
    if (kept_[size_class].size() > keep_count) return release(size_class, 0);
  }
  SHOAL_CHECK(false && "no kept buffer to release");
}

void PageBuffers::release(unsigned size_class, size_t index) {
  auto& kept = kept_[size_class];
  const Kept released = kept[index];
  kept.erase(kept.begin() + static_cast<ptrdiff_t>(index));
  kept_bytes_ -= released.charge_bytes;
  SHOAL_UNPOISON(released.data, extent_bytes(size_class));
  forget_memory(released.data, released.charge_bytes);
  SHOAL_POISON(released.data, extent_bytes(size_class));
  untouched_[size_class].push_back(released.data);
}

Result<std::byte*> PageBuffers::new_extent(uint64_t bytes) {
  if (bytes > fresh_bytes_) {
    const uint64_t size = std::max(bytes, kMappingBytes);
    void* address =
        ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (address == MAP_FAILED) {
      return Error{ErrorCode::kMemoryCap,
                   fmt::format("the system gave no address space for the page cache: asked for {} bytes", size)};
    }
    // A huge page would make memory resident that was never charged: the untouched ends of the extents.
    (void)::madvise(address, size, MADV_NOHUGEPAGE);
    // What is left of the mapping before is too small for this extent, and is address space only.
    fresh_ = static_cast<std::byte*>(address);
    fresh_bytes_ = size;
    mappings_.push_back({fresh_, size});
  }
  std::byte* extent = fresh_;
  fresh_ += bytes;
  fresh_bytes_ -= bytes;
  return extent;
}

}  // namespace shoal
