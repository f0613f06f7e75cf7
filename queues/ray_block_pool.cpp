#include "queues/ray_block_pool.h"

#include <mutex>

#include "io/result.h"

namespace shoal {

RayBlockPool::RayBlockPool(uint32_t block_count) : blocks_(block_count), counts_(block_count), nexts_(block_count) {}

BlockId RayBlockPool::acquire() {
  std::lock_guard guard(lock_);
  BlockId id = free_;
  if (id != kNoIndex) {
    free_ = nexts_[id];
  } else {
    SHOAL_CHECK(untouched_ < block_count());
    id = untouched_++;
  }
  if (++used_ > peak_used_) peak_used_ = used_;
  counts_[id] = 0;
  nexts_[id] = kNoIndex;
  return id;
}

void RayBlockPool::release(BlockId id) {
  std::lock_guard guard(lock_);
  nexts_[id] = free_;
  free_ = id;
  --used_;
}

}  // namespace shoal
