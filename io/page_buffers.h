// Memory for decoded pages, straight from the system, so that what is charged is what the process holds: malloc
// would keep freed memory between the pages in use.
//
// Properties and assumptions
//   address space  a page sits at the start of an extent whose size is a power of two; extents are never given
//   back,
//                  only their memory is. Address space that is not touched costs nothing.
//   memory         a page of n bytes is charged n rounded up to 4 KiB, never less than 4 KiB. Memory behind that in
//                  the extent is untouched: it reads as zero from the system's shared zero page, at no charge.
//   reuse          the buffer of an evicted page is kept, and the next page of its extent size takes it over as it
//                  is: no page faults where both were touched; what is too much goes back to the system.
//   threads        one at a time (the page cache's lock).
//   cost           take: none, or a trim (one system call), or page faults at first touch.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/page_file.h"
#include "io/result.h"

namespace shoal {

/// Readable zero bytes after the end of every page.
inline constexpr uint32_t kPageTailBytes = 64;

class PageBuffers {
 public:
  PageBuffers() = default;
  PageBuffers(const PageBuffers&) = delete;
  PageBuffers& operator=(const PageBuffers&) = delete;
  ~PageBuffers();

  static uint64_t charge_bytes(uint32_t page_bytes);

  /// A buffer for a page; its first kPageTailBytes after the page are zeroed by zero_tail() once the page is there.
  /// Fails with: kMemoryCap (no address space).
  Result<std::byte*> take(uint32_t page_bytes);
  static void zero_tail(std::byte* data, uint32_t page_bytes);
  /// Takes back the buffer of a page, memory included.
  void keep(std::byte* data, uint32_t page_bytes);

  /// Charges of all kept buffers.
  uint64_t kept_bytes() const { return kept_bytes_; }
  /// Charge of the kept buffer that take(page_bytes) would use, 0 when it would use none.
  uint64_t reusable_bytes(uint32_t page_bytes) const;
  /// Gives the memory of one kept buffer back to the system, but not of the one counted by
  /// reusable_bytes(page_bytes). Requires: there is such a one.
  void release_other(uint32_t page_bytes);

 private:
  static constexpr unsigned kClassCount =
      17;  // extents of 4 KiB << class; the largest page and its tail take 128 MiB
  struct Kept {
    std::byte* data;
    uint64_t charge_bytes;
  };
  struct Mapping {
    std::byte* data;
    uint64_t bytes;
  };
  static unsigned class_of(uint32_t page_bytes);
  Result<std::byte*> new_extent(uint64_t bytes);
  void release(unsigned size_class, size_t index);

  std::array<std::vector<Kept>, kClassCount> kept_;             // memory and address space
  std::array<std::vector<std::byte*>, kClassCount> untouched_;  // address space only
  uint64_t kept_bytes_ = 0;
  std::vector<Mapping> mappings_;
  std::byte* fresh_ = nullptr;  // of the newest mapping, what no extent has taken yet
  uint64_t fresh_bytes_ = 0;
};

}  // namespace shoal
