// Paths that wait to be shaded in a treelet: a list for each treelet, linked through a word of each path's own that the
// caller keeps (PathState::next), so that waiting costs no memory of its own and following a list touches nothing but
// the paths. A path is in at most one list.
//
// Threads: any number; push and take are lock-free (one compare-exchange, two exchanges). Order: last in, first out.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "treelets/ray.h"

namespace shoal {

class PathLists {
 public:
  explicit PathLists(uint32_t list_count) : lists_(std::make_unique<List[]>(list_count)) {}

  static uint64_t bytes(uint32_t list_count) { return uint64_t{list_count} * sizeof(List); }

  /// `next` is the path's link: the path that waited before it, or kNoIndex.
  void push(uint32_t list, uint32_t path, uint32_t& next) {
    List& l = lists_[list];
    uint32_t head = l.head.load(std::memory_order_relaxed);
    do {
      next = head;
    } while (!l.head.compare_exchange_weak(head, path, std::memory_order_release, std::memory_order_relaxed));
    l.count.fetch_add(1, std::memory_order_release);
  }

  /// All paths of a list: the first, the others by their links; kNoIndex: none. Read a link before its path is pushed
  /// anywhere again.
  uint32_t take(uint32_t list) {
    List& l = lists_[list];
    // The count first: a push that comes between is taken and counted too much until the next take, which makes up for
    // it. The other way round it would wait and not be counted, and nobody would come for it.
    if (l.count.load(std::memory_order_relaxed) > 0) l.count.exchange(0, std::memory_order_acquire);
    if (l.head.load(std::memory_order_relaxed) == kNoIndex) return kNoIndex;
    return l.head.exchange(kNoIndex, std::memory_order_acquire);
  }

  /// A snapshot, which a push and a take at once may leave too high until the next take, never too low for long.
  uint32_t waiting(uint32_t list) const { return lists_[list].count.load(std::memory_order_relaxed); }
  bool empty(uint32_t list) const { return lists_[list].head.load(std::memory_order_relaxed) == kNoIndex; }

 private:
  struct List {
    std::atomic<uint32_t> head{kNoIndex};
    std::atomic<uint32_t> count{0};
  };
  std::unique_ptr<List[]> lists_;
};

}  // namespace shoal
