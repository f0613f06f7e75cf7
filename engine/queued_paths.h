// The paths in flight of a queued render and where they wait: path states, ray queues, paths waiting to be shaded.
//
// Properties and assumptions
//   capacity   fixed at construction: `path_count` paths, each with the slots of its two rays (queues/treelet_queues.h).
//   ownership  a path belongs to the thread that handles its last ray; a free path to nobody.
//   threads    any number.
#pragma once

#include <memory>

#include "engine/path_state.h"
#include "engine/pause_gate.h"
#include "io/huge_memory.h"
#include "queues/path_lists.h"
#include "queues/treelet_queues.h"

namespace shoal {

class QueuedPaths final : public UnfinishedPaths {
 public:
  QueuedPaths(uint32_t treelet_count, uint32_t path_count, unsigned threads)
      : rays(treelet_count, path_count, threads),
        to_shade(treelet_count),
        states_(path_count),
        path_count_(path_count) {}

  static uint64_t bytes(uint32_t treelet_count, uint32_t path_count, unsigned threads) {
    return state_bytes(treelet_count, path_count) + TreeletQueues::bytes(treelet_count, path_count, threads);
  }
  /// Of `bytes`, what is not rays and their queues.
  static uint64_t state_bytes(uint32_t treelet_count, uint32_t path_count) {
    return uint64_t{path_count} * sizeof(PathState) + PathLists::bytes(treelet_count);
  }

  PathState& state(uint32_t path) { return states_[path]; }
  /// Asks for the path's memory, which is somewhere else for every ray: it comes while the ray before is traced.
  /// States are not aligned to cache lines: one lies in two or three.
  void prefetch(uint32_t path) const {
    const auto* bytes = reinterpret_cast<const std::byte*>(&states_[path]);
    __builtin_prefetch(bytes, 1);
    __builtin_prefetch(bytes + kCacheLineBytes, 1);
    __builtin_prefetch(bytes + sizeof(PathState) - 1, 1);
  }
  uint32_t path_count() const { return path_count_; }
  void each_unfinished(const VisitUnfinished& visit) const override {
    for (uint32_t path = 0; path < untouched_; ++path) visit_unfinished(states_[path], visit);
  }

  /// Takes up to `wanted` free paths as a list linked by PathState::next; returns how many.
  uint32_t take_free(uint32_t wanted, uint32_t* first) {
    std::lock_guard guard(lock_);
    uint32_t taken = 0;
    *first = kNoIndex;
    while (taken < wanted) {
      uint32_t path = free_;
      if (path != kNoIndex) {
        free_ = states_[path].next;
      } else if (untouched_ < path_count_) {
        path = untouched_++;
        std::construct_at(&states_[path]);
      } else {
        break;
      }
      states_[path].next = *first;
      *first = path;
      ++taken;
    }
    free_count_.fetch_sub(taken, std::memory_order_relaxed);
    return taken;
  }
  /// Gives back `count` paths, linked by PathState::next from `first` to `last`.
  void give_back(uint32_t first, uint32_t last, uint32_t count) {
    std::lock_guard guard(lock_);
    states_[last].next = free_;
    free_ = first;
    free_count_.fetch_add(count, std::memory_order_relaxed);
  }
  void give_back(uint32_t path) { give_back(path, path, 1); }
  uint32_t free_count() const {
    const int64_t count = free_count_.load(std::memory_order_relaxed) + int64_t{path_count_};
    return count > 0 ? static_cast<uint32_t>(count) : 0;
  }

  uint32_t waiting(TreeletId treelet) const { return rays.waiting(treelet) + to_shade.waiting(treelet); }

  TreeletQueues rays;
  PathLists to_shade;

 private:
  static constexpr size_t kCacheLineBytes = 64;
  HugeArray<PathState> states_;
  uint32_t path_count_;
  SpinLock lock_;
  uint32_t free_ = kNoIndex;
  uint32_t untouched_ = 0;
  std::atomic<int64_t> free_count_{0};  ///< less path_count_
};

/// Ended paths of one thread: given back together, so that ending one costs no lock.
class EndedPaths {
 public:
  explicit EndedPaths(QueuedPaths& paths) : paths_(paths) {}

  uint32_t count() const { return count_; }
  void add(uint32_t path) {
    if (count_ == 0) last_ = path;
    paths_.state(path).next = first_;
    first_ = path;
    ++count_;
  }
  void give_back() {
    if (count_ > 0) paths_.give_back(first_, last_, count_);
    first_ = last_ = kNoIndex;
    count_ = 0;
  }

 private:
  QueuedPaths& paths_;
  uint32_t first_ = kNoIndex, last_ = kNoIndex, count_ = 0;
};

}  // namespace shoal
