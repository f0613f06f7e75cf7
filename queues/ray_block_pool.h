// Blocks of rays from one preallocated pool.
//
// Properties and assumptions
//   capacity   fixed at construction; a block holds kRaysPerBlock rays by value (4 KiB).
//   ownership  acquire() gives a block to the caller until release().
//   threads    any number; one short lock an operation, that is one a block and not one a ray.
//   when full  acquire() must not be called: the owner of the pool proves that blocks suffice
//              (TreeletQueues::blocks_needed), so running out is a bug of ours and ends in SHOAL_CHECK.
#pragma once

#include <cstdint>
#include <vector>

#include "io/huge_memory.h"
#include "queues/spin_lock.h"
#include "treelets/ray.h"

namespace shoal {

using BlockId = uint32_t;
inline constexpr uint32_t kRaysPerBlock = 64;

struct RayBlock {
  Ray rays[kRaysPerBlock];
};
static_assert(sizeof(RayBlock) == 4096);

class RayBlockPool {
 public:
  explicit RayBlockPool(uint32_t block_count);

  BlockId acquire();
  void release(BlockId block);

  RayBlock& block(BlockId id) { return blocks_[id]; }
  /// Rays in the block and the next block of its queue: kept apart so that a block is all rays.
  uint32_t& count(BlockId id) { return counts_[id]; }
  BlockId& next(BlockId id) { return nexts_[id]; }

  uint32_t block_count() const { return static_cast<uint32_t>(counts_.size()); }
  uint32_t peak_used_count() const { return peak_used_; }
  static uint64_t bytes(uint32_t block_count) { return uint64_t{block_count} * (sizeof(RayBlock) + 8); }

 private:
  HugeArray<RayBlock> blocks_;
  std::vector<uint32_t> counts_;
  std::vector<BlockId> nexts_;
  SpinLock lock_;
  BlockId free_ = kNoIndex;
  uint32_t untouched_ = 0;  ///< blocks never used yet: their memory is not touched before it is needed
  uint32_t used_ = 0, peak_used_ = 0;
};

}  // namespace shoal
