// The queued order in memory: rays wait by value in blocks for each treelet, and a treelet's rays are traced together
// while its nodes are in the core's caches. Made for speed where nothing is read from disk: hence not engine's queues.
//
// Properties and assumptions
//   queues    a thread appends to blocks of its own, one open block for each treelet, without a lock; a block that is
//             full is shared: it joins the treelet's list by one compare-and-swap, for whoever drains next.
//   draining  a thread takes the whole list of a treelet at once (an exchange, so that no block comes back while its
//             successor is read), then its own open block. Other threads' open blocks stay theirs.
//   bypass    a ray whose next treelet is the one in hand goes on at once.
//   blocks    a thread keeps free ones; chains of them go through a lock once in kChainBlocks blocks.
//   capacity  full blocks hold at most all rays in flight, each thread has at most an open block a treelet, the block
//             that it reads, and 2 kChainBlocks free ones; so a push always finds a block.
//   ends      when all rays were begun and none is in flight; a thread that finds nothing yields until then.
#include <atomic>
#include <mutex>
#include <thread>

#include "bench/memory_orders.h"
#include "queues/spin_lock.h"

namespace shoal::bench {
namespace {

constexpr uint32_t kBlockRays = 64;
constexpr size_t kChainBlocks = 64;

struct Block {
  Ray rays[kBlockRays];
};

/// Blocks that no thread has.
class BlockStore {
 public:
  explicit BlockStore(uint32_t count) : blocks(count), next(count), count_(count) {}

  void clear() { used_ = 0, spare_.clear(); }
  /// Appends kChainBlocks free blocks.
  void take(std::vector<uint32_t>& out) {
    const std::lock_guard guard(lock_);
    if (spare_.empty()) {
      SHOAL_CHECK(used_ + kChainBlocks <= count_);
      for (size_t i = 0; i < kChainBlocks; ++i) out.push_back(used_++);
    } else {
      out.insert(out.end(), spare_.end() - kChainBlocks, spare_.end());
      spare_.resize(spare_.size() - kChainBlocks);
    }
  }
  /// The last kChainBlocks of `from`.
  void give(std::vector<uint32_t>& from) {
    const std::lock_guard guard(lock_);
    spare_.insert(spare_.end(), from.end() - kChainBlocks, from.end());
    from.resize(from.size() - kChainBlocks);
  }

  HugeArray<Block> blocks;
  std::vector<uint32_t> next;  ///< of a block in a list

 private:
  SpinLock lock_;
  std::vector<uint32_t> spare_;
  uint32_t used_ = 0, count_;
};

/// Full blocks that wait for a treelet.
struct SharedQueue {
  std::atomic<uint32_t> head{kNoIndex};
  std::atomic<uint32_t> blocks{0};
};

/// What the threads of one order share; the lower part is about one run.
struct QueuedContext {
  QueuedContext(const MemoryScene& memory_scene, const OrderOptions& order_options, uint64_t limit, uint32_t blocks)
      : scene(memory_scene), options(order_options), in_flight_limit(limit), store(blocks),
        queues(memory_scene.pages.size()) {}

  const MemoryScene& scene;
  const OrderOptions options;
  const uint64_t in_flight_limit;
  BlockStore store;
  std::vector<SharedQueue> queues;

  const RaySet* set = nullptr;
  std::span<RayAnswer> answers;
  std::atomic<uint64_t> next_ray{0}, in_flight{0};
};

class QueuedThread {
 public:
  QueuedThread(QueuedContext& context, unsigned thread)
      : context_(context),
        tree_(context.scene.top_tree()),
        open_(context.queues.size()),
        first_(static_cast<uint32_t>(context.queues.size() * thread / context.options.threads)) {}

  /// All queues are empty before and after.
  TraceCounts run() {
    free_.clear();
    counts_ = {};
    cursor_ = first_;
    while (!ended()) {
      while (admit()) {
      }
      const TreeletId treelet = choose();
      if (treelet != kNoIndex) {
        drain(treelet);
      } else {
        std::this_thread::yield();
      }
    }
    return counts_;
  }

 private:
  struct OpenBlock {
    uint32_t block = kNoIndex, count = 0;
  };

  /// Rays count as in flight before they count as begun: so this order of reading.
  bool ended() const { return context_.next_ray >= context_.set->rays.size() && context_.in_flight == 0; }

  /// Begins the next rays; false when there are none, or no room for them.
  bool admit() {
    const LargeVector<BenchRay>& rays = context_.set->rays;
    if (context_.next_ray >= rays.size() || context_.in_flight + kRaysPerGrab > context_.in_flight_limit) return false;
    context_.in_flight += kRaysPerGrab;
    const uint64_t first = context_.next_ray.fetch_add(kRaysPerGrab);
    const uint64_t last = std::min<uint64_t>(std::max<uint64_t>(first, rays.size()), first + kRaysPerGrab);
    done_ = kRaysPerGrab - (last - first);
    uint64_t i = first;
    travel(kNoIndex, [&] {
      if (i == last) return false;
      group_.add(begin_ray(rays[i], static_cast<uint32_t>(i), context_.set->any_hit), nullptr);
      ++i;
      return true;
    });
    context_.in_flight -= done_;
    return true;
  }

  uint64_t waiting(TreeletId treelet) const {
    return uint64_t{kBlockRays} * context_.queues[treelet].blocks.load(std::memory_order_relaxed) +
           open_[treelet].count;
  }

  /// A treelet with rays that this thread can have, or kNoIndex.
  TreeletId choose() {
    const auto count = static_cast<uint32_t>(open_.size());
    uint64_t most = 0;
    TreeletId best = kNoIndex;
    for (uint32_t step = 0; step < count; ++step) {
      cursor_ = cursor_ + 1 < count ? cursor_ + 1 : 0;
      const uint64_t rays = waiting(cursor_);
      if (rays > most) most = rays, best = cursor_;
      if (rays > 0 && context_.options.choice == QueueChoice::kSweep) break;
    }
    return best;
  }

  void drain(TreeletId treelet) {
    done_ = 0;
    ++counts_.drains;
    SharedQueue& queue = context_.queues[treelet];
    uint32_t block = queue.head.load(std::memory_order_relaxed) == kNoIndex
                         ? kNoIndex
                         : queue.head.exchange(kNoIndex, std::memory_order_acquire);
    const OpenBlock own = open_[treelet];
    open_[treelet] = {};
    uint32_t count = kBlockRays, next = 0;
    if (block == kNoIndex) block = own.block, count = own.count;
    const std::byte* page = context_.scene.pages[treelet].data();
    travel(treelet, [&] {
      if (block == kNoIndex) return false;
      group_.add(context_.store.blocks[block].rays[next++], page);
      if (next < count) return true;
      const uint32_t used = block;
      next = 0;
      if (block == own.block) {
        block = kNoIndex;
      } else {
        block = context_.store.next[used];
        queue.blocks.fetch_sub(1, std::memory_order_relaxed);
        if (block == kNoIndex) block = own.block, count = own.count;
      }
      give_back(used);
      return true;
    });
    context_.in_flight -= done_;
  }

  void give_back(uint32_t block) {
    free_.push_back(block);
    if (free_.size() >= 2 * kChainBlocks) context_.store.give(free_);
  }

  /// Keeps the group full with what `more` adds to it until there is no more, and every ray has gone elsewhere.
  template <class More>
  void travel(TreeletId in_hand, const More& more) {
    const std::byte* page = in_hand == kNoIndex ? nullptr : context_.scene.pages[in_hand].data();
    const auto decide = [&](uint32_t, const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex && treelet == in_hand) return page;
      counts_.node_tests += member.node_tests, counts_.triangle_tests += member.triangle_tests;
      if (treelet != kNoIndex) {
        push(treelet, member.ray);
      } else {
        context_.answers[member.ray.path & ~Ray::kAnyHitBit] = answer_of(member.ray);
        ++done_;
      }
      return nullptr;
    };
    for (bool left = true;;) {
      while (left && !group_.full() && (left = more())) {
      }
      if (group_.size() == 0) return;
      counts_.treelet_visits += group_.step(tree_, trace_counters_, decide);
    }
  }

  void push(TreeletId treelet, const Ray& ray) {
    OpenBlock& open = open_[treelet];
    if (open.block == kNoIndex) {
      if (free_.empty()) context_.store.take(free_);
      open.block = free_.back();
      free_.pop_back();
    }
    context_.store.blocks[open.block].rays[open.count++] = ray;
    if (open.count < kBlockRays) return;
    share(context_.queues[treelet], open.block);
    open = {};
  }

  void share(SharedQueue& queue, uint32_t block) {
    queue.blocks.fetch_add(1, std::memory_order_relaxed);
    uint32_t head = queue.head.load(std::memory_order_relaxed);
    do {
      context_.store.next[block] = head;
    } while (!queue.head.compare_exchange_weak(head, block, std::memory_order_release, std::memory_order_relaxed));
  }

  QueuedContext& context_;
  const TopTree& tree_;
  std::vector<OpenBlock> open_;  ///< by treelet
  std::vector<uint32_t> free_;
  RayGroup group_;
  TraceCounters trace_counters_;
  TraceCounts counts_;
  uint64_t done_ = 0;  ///< rays of this drain, or of this admission, whose answer is known
  uint32_t first_, cursor_ = 0;
};

class QueuedOrder : public RayOrder {
 public:
  QueuedOrder(const MemoryScene& scene, const OrderOptions& options, uint64_t in_flight, uint32_t blocks)
      : context_(scene, options, in_flight, blocks) {
    for (unsigned thread = 0; thread < options.threads; ++thread) {
      threads_.push_back(std::make_unique<QueuedThread>(context_, thread));
    }
  }

  OrderRun run(const RaySet& set, std::span<RayAnswer> answers) override {
    context_.set = &set;
    context_.answers = answers;
    context_.next_ray = 0;
    context_.store.clear();
    std::mutex mutex;
    OrderRun result;
    result.seconds = run_together(context_.options.threads, [&](unsigned thread) {
      const TraceCounts counts = threads_[thread]->run();
      const std::lock_guard guard(mutex);
      result.counts.add(counts);
    });
    return result;
  }

 private:
  QueuedContext context_;
  std::vector<std::unique_ptr<QueuedThread>> threads_;
};

}  // namespace

std::unique_ptr<RayOrder> make_queued_order(const MemoryScene& scene, const OrderOptions& options, uint64_t ray_count) {
  // Each thread looks, then adds: so a grab a thread beyond the limit, and at least one within it.
  const uint64_t grabs = uint64_t{options.threads} * kRaysPerGrab;
  const uint64_t in_flight = std::max(std::min(options.in_flight, ray_count + grabs), grabs);
  const uint64_t blocks = (in_flight + grabs) / kBlockRays +
                          options.threads * (scene.pages.size() + 1 + 3 * kChainBlocks) + kChainBlocks;
  return std::make_unique<QueuedOrder>(scene, options, in_flight, static_cast<uint32_t>(blocks));
}

}  // namespace shoal::bench
