// Where rays wait: a queue of ray blocks for each treelet.
//
// Properties and assumptions
//   order      none promised: a drain takes the newest block first. Pictures do not depend on it.
//   ownership  push() copies the rays; take() hands all blocks of a queue to the caller, who gives each back to the
//              pool after reading it (RayBatch does both).
//   capacity   every path owns at most two rays, so with blocks_needed(paths) blocks a push always finds a place:
//              full blocks hold at most all rays, and each queue (or batch being drained) has one block
//              that is not full. Draining never allocates, hence nothing can deadlock.
//   threads    any number; one lock a push on the queue of that treelet (a thread gathers rays in a RayOutbox before).
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

#include "queues/ray_block_pool.h"
#include "queues/spin_lock.h"

namespace shoal {

class TouchLog;
class TreeletQueues;

/// The rays of one drain, block by block. A block goes back to the pool before its rays are handled, so that
/// routing them always finds room.
class RayBatch {
 public:
  RayBatch(RayBlockPool& pool, BlockId first) : pool_(&pool), next_(first) {}
  /// Copies the next block's rays to `out` and frees the block; 0 at the end.
  uint32_t next_block(RayBlock& out);
  /// The rays of the next block, where they are now.
  std::span<const Ray> next_rays() const;
  /// `look(ray)` at every ray that is left, without taking it.
  template <class Look>
  void each(const Look& look) const {
    for (BlockId block = next_; block != kNoIndex; block = pool_->next(block)) {
      for (uint32_t i = 0; i < pool_->count(block); ++i) look(pool_->block(block).rays[i]);
    }
  }

 private:
  RayBlockPool* pool_;
  BlockId next_;
};

class TreeletQueues {
 public:
  TreeletQueues(uint32_t treelet_count, uint32_t path_count, unsigned threads);

  static uint32_t blocks_needed(uint32_t treelet_count, uint32_t path_count, unsigned threads);
  /// Memory of queues and pool for these numbers.
  static uint64_t bytes(uint32_t treelet_count, uint32_t path_count, unsigned threads);

  /// `touches`: told where the rays go, when somebody measures.
  void push(TreeletId treelet, std::span<const Ray> rays, TouchLog* touches = nullptr);
  void push(TreeletId treelet, const Ray& ray) { push(treelet, {&ray, 1}); }
  RayBatch take(TreeletId treelet);

  uint32_t treelet_count() const { return treelet_count_; }
  /// Rays waiting; a snapshot that other threads may change.
  uint32_t waiting(TreeletId treelet) const { return queues_[treelet].rays.load(std::memory_order_relaxed); }
  uint32_t peak_blocks_count() const { return pool_.peak_used_count(); }

 private:
  struct alignas(16) Queue {
    SpinLock lock;
    std::atomic<uint32_t> rays{0};
    BlockId head = kNoIndex;
  };
  uint32_t treelet_count_;
  std::unique_ptr<Queue[]> queues_;
  RayBlockPool pool_;
};

}  // namespace shoal
