// bench/queued_memory_order over again on one thread, with what it touches told to a TouchLog. The same treelets are
// drained in the same order, and blocks are taken and given back in the same order: so they lie in cache, or not, as
// they do there.
#include "bench/touched_orders.h"

namespace shoal::bench {
namespace {

constexpr uint32_t kBlockRays = 64;
constexpr size_t kChainBlocks = 64;

struct Block {
  Ray rays[kBlockRays];
};

struct OpenBlock {
  uint32_t block = kNoIndex, count = 0;
};

struct FullBlocks {
  uint32_t head = kNoIndex, blocks = 0;
};

/// Blocks that are free: a thread's own, and those of the store behind it.
class FreeBlocks {
 public:
  explicit FreeBlocks(TouchLog& log) : log_(log) {}

  uint32_t take() {
    if (own_.empty()) refill();
    const uint32_t block = own_.back();
    log_.read(own_.back(), TouchKind::kQueues);
    own_.pop_back();
    return block;
  }
  void give_back(uint32_t block) {
    own_.push_back(block);
    log_.write(own_.back(), TouchKind::kQueues);
    if (own_.size() >= 2 * kChainBlocks) move_chain(own_, spare_);
  }

 private:
  void refill() {
    if (!spare_.empty()) return move_chain(spare_, own_);
    for (size_t i = 0; i < kChainBlocks; ++i) own_.push_back(used_++);
    log_.write(own_.data(), kChainBlocks * sizeof(uint32_t), TouchKind::kQueues);
  }
  void move_chain(std::vector<uint32_t>& from, std::vector<uint32_t>& to) {
    to.insert(to.end(), from.end() - kChainBlocks, from.end());
    log_.read(from.data() + from.size() - kChainBlocks, kChainBlocks * sizeof(uint32_t), TouchKind::kQueues);
    log_.write(to.data() + to.size() - kChainBlocks, kChainBlocks * sizeof(uint32_t), TouchKind::kQueues);
    from.resize(from.size() - kChainBlocks);
  }

  TouchLog& log_;
  std::vector<uint32_t> own_, spare_;
  uint32_t used_ = 0;
};

class TouchedQueued {
 public:
  TouchedQueued(const MemoryScene& scene, const OrderOptions& options, const RaySet& set, std::span<RayAnswer> answers,
                uint64_t in_flight_limit, uint64_t blocks, TouchLog& log)
      : scene_(scene), choice_(options.choice), set_(set), answers_(answers), in_flight_limit_(in_flight_limit),
        log_(log), blocks_(blocks), next_(blocks), full_(scene.pages.size()), open_(scene.pages.size()),
        free_(log), group_(log) {}

  TraceCounts run() {
    while (next_ray_ < set_.rays.size() || in_flight_ > 0) {
      while (admit()) {
      }
      const TreeletId treelet = choose();
      if (treelet != kNoIndex) drain(treelet);
    }
    return counts_;
  }

 private:
  bool admit() {
    const uint64_t count = set_.rays.size();
    if (next_ray_ >= count || in_flight_ + kRaysPerGrab > in_flight_limit_) return false;
    const uint64_t last = std::min<uint64_t>(count, next_ray_ + kRaysPerGrab);
    in_flight_ += last - next_ray_;
    uint64_t i = next_ray_;
    next_ray_ = last;
    travel(kNoIndex, [&] {
      if (i == last) return false;
      group_.add(begin_touching(set_, i++, log_), nullptr);
      return true;
    });
    return true;
  }

  TreeletId choose() {
    const auto count = static_cast<uint32_t>(open_.size());
    uint64_t most = 0;
    TreeletId best = kNoIndex;
    for (uint32_t step = 0; step < count; ++step) {
      cursor_ = cursor_ + 1 < count ? cursor_ + 1 : 0;
      log_.read(full_[cursor_], TouchKind::kQueues);
      log_.read(open_[cursor_], TouchKind::kQueues);
      const uint64_t rays = uint64_t{kBlockRays} * full_[cursor_].blocks + open_[cursor_].count;
      if (rays > most) most = rays, best = cursor_;
      if (rays > 0 && choice_ == QueueChoice::kSweep) break;
    }
    return best;
  }

  void drain(TreeletId treelet) {
    ++counts_.drains;
    FullBlocks& queue = full_[treelet];
    log_.write(queue, TouchKind::kQueues);
    log_.write(open_[treelet], TouchKind::kQueues);
    uint32_t block = std::exchange(queue.head, kNoIndex);
    const OpenBlock own = std::exchange(open_[treelet], {});
    uint32_t count = kBlockRays, next = 0;
    if (block == kNoIndex) block = own.block, count = own.count;
    const std::byte* page = page_touching(scene_, treelet, log_);
    travel(treelet, [&] {
      if (block == kNoIndex) return false;
      const Ray& ray = blocks_[block].rays[next++];
      log_.read(ray, TouchKind::kQueues);
      group_.add(ray, page);
      if (next < count) return true;
      const uint32_t used = block;
      next = 0;
      if (block == own.block) {
        block = kNoIndex;
      } else {
        log_.read(next_[used], TouchKind::kQueues);
        block = next_[used];
        --queue.blocks;
        log_.write(queue, TouchKind::kQueues);
        if (block == kNoIndex) block = own.block, count = own.count;
      }
      free_.give_back(used);
      return true;
    });
  }

  template <class More>
  void travel(TreeletId in_hand, const More& more) {
    const std::byte* page = in_hand == kNoIndex ? nullptr : scene_.pages[in_hand].data();
    const auto decide = [&](const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex && treelet == in_hand) return page;
      counts_.node_tests += member.node_tests, counts_.triangle_tests += member.triangle_tests;
      if (treelet != kNoIndex) {
        push(treelet, member.ray);
      } else {
        answer_touching(member.ray, answers_, log_);
        --in_flight_;
      }
      return nullptr;
    };
    for (bool left = true;;) {
      while (left && !group_.full() && (left = more())) {
      }
      if (group_.size() == 0) return;
      counts_.treelet_visits += group_.step(scene_.top_tree(), trace_counters_, decide);
    }
  }

  void push(TreeletId treelet, const Ray& ray) {
    OpenBlock& open = open_[treelet];
    log_.write(open, TouchKind::kQueues);
    if (open.block == kNoIndex) open.block = free_.take();
    Ray& place = blocks_[open.block].rays[open.count++];
    place = ray;
    log_.write(place, TouchKind::kQueues);
    if (open.count < kBlockRays) return;
    FullBlocks& queue = full_[treelet];
    next_[open.block] = std::exchange(queue.head, open.block);
    ++queue.blocks;
    log_.write(queue, TouchKind::kQueues);
    log_.write(next_[open.block], TouchKind::kQueues);
    open = {};
  }

  const MemoryScene& scene_;
  const QueueChoice choice_;
  const RaySet& set_;
  std::span<RayAnswer> answers_;
  const uint64_t in_flight_limit_;
  TouchLog& log_;
  HugeArray<Block> blocks_;
  std::vector<uint32_t> next_;  ///< of a block in a list
  std::vector<FullBlocks> full_;
  std::vector<OpenBlock> open_;
  FreeBlocks free_;
  TouchedGroup group_;
  TraceCounters trace_counters_;
  TraceCounts counts_;
  uint64_t next_ray_ = 0, in_flight_ = 0;
  uint32_t cursor_ = 0;
};

}  // namespace

TraceCounts touch_queued_order(const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                               std::span<RayAnswer> answers, TouchLog& log) {
  // Limit and blocks as make_queued_order() has them.
  const uint64_t count = set.rays.size();
  const uint64_t in_flight = std::max(std::min(options.in_flight, count + kRaysPerGrab), kRaysPerGrab);
  const uint64_t blocks =
      (in_flight + kRaysPerGrab) / kBlockRays + scene.pages.size() + 1 + 4 * kChainBlocks;
  return std::make_unique<TouchedQueued>(scene, options, set, answers, in_flight, blocks, log)->run();
}

}  // namespace shoal::bench
