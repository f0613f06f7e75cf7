#include "queues/treelet_queues.h"

#include <algorithm>
#include <cstring>
#include <mutex>

#include "treelets/touch_log.h"

namespace shoal {

uint32_t RayBatch::next_block(RayBlock& out) {
  if (next_ == kNoIndex) return 0;
  const BlockId block = next_;
  const uint32_t count = pool_->count(block);
  std::copy_n(pool_->block(block).rays, count, out.rays);
  next_ = pool_->next(block);
  pool_->release(block);
  return count;
}

std::span<const Ray> RayBatch::next_rays() const {
  if (next_ == kNoIndex) return {};
  return {pool_->block(next_).rays, pool_->count(next_)};
}

uint32_t TreeletQueues::blocks_needed(uint32_t treelet_count, uint32_t path_count, unsigned threads) {
  const uint64_t rays = 2ull * path_count;
  const uint64_t full = (rays + kRaysPerBlock - 1) / kRaysPerBlock;
  const uint64_t partial = std::min<uint64_t>(rays, treelet_count) + threads;
  return static_cast<uint32_t>(std::min<uint64_t>(full + partial, rays + threads));
}

uint64_t TreeletQueues::bytes(uint32_t treelet_count, uint32_t path_count, unsigned threads) {
  return RayBlockPool::bytes(blocks_needed(treelet_count, path_count, threads)) +
         uint64_t{treelet_count} * sizeof(Queue);
}

TreeletQueues::TreeletQueues(uint32_t treelet_count, uint32_t path_count, unsigned threads)
    : treelet_count_(treelet_count),
      queues_(std::make_unique<Queue[]>(treelet_count)),
      pool_(blocks_needed(treelet_count, path_count, threads)) {}

void TreeletQueues::push(TreeletId treelet, std::span<const Ray> rays, TouchLog* touches) {
  Queue& queue = queues_[treelet];
  std::lock_guard guard(queue.lock);
  for (size_t pushed = 0; pushed < rays.size();) {
    if (queue.head == kNoIndex || pool_.count(queue.head) == kRaysPerBlock) {
      const BlockId block = pool_.acquire();
      pool_.next(block) = queue.head;
      queue.head = block;
    }
    uint32_t& count = pool_.count(queue.head);
    const size_t fitting = std::min<size_t>(rays.size() - pushed, kRaysPerBlock - count);
    Ray* const to = pool_.block(queue.head).rays + count;
    std::copy_n(rays.data() + pushed, fitting, to);
    if (touches != nullptr) touches->write(to, fitting * sizeof(Ray), TouchKind::kQueues);
    count += static_cast<uint32_t>(fitting);
    pushed += fitting;
  }
  const uint32_t waiting = queue.rays.load(std::memory_order_relaxed);
  queue.rays.store(waiting + static_cast<uint32_t>(rays.size()), std::memory_order_relaxed);
}

RayBatch TreeletQueues::take(TreeletId treelet) {
  Queue& queue = queues_[treelet];
  std::lock_guard guard(queue.lock);
  const BlockId head = queue.head;
  queue.head = kNoIndex;
  queue.rays.store(0, std::memory_order_relaxed);
  return RayBatch(pool_, head);
}

}  // namespace shoal
