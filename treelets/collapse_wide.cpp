#include "treelets/collapse_wide.h"

#include <tbb/parallel_invoke.h>

#include <limits>

namespace shoal {
namespace {

constexpr uint32_t kSerialCount = 8192;  // references below which a subtree is one task

constexpr uint32_t shift_of(uint32_t slots) { return 4 * (slots - 2); }

}  // namespace

WidePlan::WidePlan(std::span<const BinaryNode> tree) : WidePlan(tree, {}) {}

WidePlan::WidePlan(std::span<const BinaryNode> tree, std::span<const uint32_t> closed)
    : tree_(tree), closed_(closed), choice_(tree.size()) {
  plan(0);
}

WidePlan::Costs WidePlan::plan(uint32_t node) {
  Costs costs{};
  if (closed(node)) return costs;  // what lies below costs the same wherever it hangs
  Costs left, right;
  const uint32_t child = tree_[node].left;
  if (tree_[node].count > kSerialCount) {
    tbb::parallel_invoke([&] { left = plan(child); }, [&] { right = plan(child + 1); });
  } else {
    left = plan(child), right = plan(child + 1);
  }
  double split[9];
  uint32_t best_left[9];
  for (uint32_t slots = 2; slots <= 8; ++slots) {
    split[slots] = std::numeric_limits<double>::infinity();
    // From the middle outwards: among equal costs the most even, which keeps degenerate trees shallow.
    for (uint32_t i = 1; i < slots; ++i) {
      const uint32_t k = i % 2 == 1 ? slots / 2 - i / 2 : slots / 2 + i / 2;
      if (k == 0 || k >= slots) continue;
      const double cost = left.at_most[k] + right.at_most[slots - k];
      if (cost < split[slots]) split[slots] = cost, best_left[slots] = k;
    }
  }
  costs.at_most[1] = half_area(tree_[node]) + split[8];
  uint32_t choice = 0;
  for (uint32_t slots = 2; slots <= 8; ++slots) {
    const bool opened = slots == 8 || split[slots] <= costs.at_most[slots - 1];
    costs.at_most[slots] = opened ? split[slots] : costs.at_most[slots - 1];
    if (opened) choice |= best_left[slots] << shift_of(slots);
  }
  choice_[node] = choice;
  return costs;
}

void WidePlan::open(uint32_t node, uint32_t slots, WideChildren& children) const {
  uint32_t left_slots = 0;
  if (!closed(node)) {
    while (slots > 1 && (left_slots = choice_[node] >> shift_of(slots) & 15) == 0) --slots;
  }
  if (left_slots == 0) {
    children.node[children.count++] = node;
    return;
  }
  open(tree_[node].left, left_slots, children);
  open(tree_[node].left + 1, slots - left_slots, children);
}

WideChildren WidePlan::children(uint32_t root) const {
  WideChildren children;
  open(root, 8, children);
  return children;
}

uint32_t WidePlan::count_nodes(uint32_t root) const {
  if (closed(root)) return 0;
  uint32_t count = 1;
  const WideChildren below = children(root);
  for (uint32_t i = 0; i < below.count; ++i) count += count_nodes(below.node[i]);
  return count;
}

}  // namespace shoal
