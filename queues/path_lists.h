// Paths that wait to be shaded in a treelet: a list for each treelet, linked through one array of a word a path, so
// that waiting costs no allocation. A path is in at most one list.
//
// Threads: any number; push and take are lock-free (one compare-exchange, one exchange). Order: last in, first out.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "io/huge_memory.h"
#include "treelets/ray.h"

namespace shoal {

class PathLists {
 public:
  PathLists(uint32_t list_count, uint32_t path_count)
      : lists_(std::make_unique<List[]>(list_count)), links_(path_count) {}

  static uint64_t bytes(uint32_t list_count, uint32_t path_count) {
    return uint64_t{list_count} * sizeof(List) + uint64_t{path_count} * sizeof(uint32_t);
  }

  void push(uint32_t list, uint32_t path) {
    List& l = lists_[list];
    uint32_t head = l.head.load(std::memory_order_relaxed);
    do {
      links_[path] = head;
    } while (!l.head.compare_exchange_weak(head, path, std::memory_order_release, std::memory_order_relaxed));
    l.count.fetch_add(1, std::memory_order_relaxed);
  }

  /// All paths of a list: the first, the others by next(); kNoIndex ends it. Read next() before the path is pushed
  /// anywhere again.
  uint32_t take(uint32_t list) {
    List& l = lists_[list];
    if (l.head.load(std::memory_order_relaxed) == kNoIndex) return kNoIndex;
    const uint32_t head = l.head.exchange(kNoIndex, std::memory_order_acquire);
    uint32_t taken = 0;
    for (uint32_t path = head; path != kNoIndex; path = links_[path]) ++taken;
    l.count.fetch_sub(taken, std::memory_order_relaxed);
    return head;
  }
  uint32_t next(uint32_t path) const { return links_[path]; }

  /// A snapshot: pushes and takes under way may be missing from it (and it is never below zero for long).
  uint32_t waiting(uint32_t list) const {
    const int32_t count = lists_[list].count.load(std::memory_order_relaxed);
    return count > 0 ? static_cast<uint32_t>(count) : 0;
  }
  bool empty(uint32_t list) const { return lists_[list].head.load(std::memory_order_relaxed) == kNoIndex; }

 private:
  struct List {
    std::atomic<uint32_t> head{kNoIndex};
    std::atomic<int32_t> count{0};
  };
  std::unique_ptr<List[]> lists_;
  HugeArray<uint32_t> links_;
};

}  // namespace shoal
