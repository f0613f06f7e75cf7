#include "treelets/linear_bvh.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <bit>

#include "treelets/morton_order.h"
#include "treelets/sah_bins.h"

namespace shoal {
namespace {

/// Writes the children of the node whose left side ends at `split - 1` to 2 * split - 1 and 2 * split: a place that
/// no other node of the tree has, as in Karras 2012, so that subtrees need not know of each other.
class RadixTreeBuilder {
 public:
  RadixTreeBuilder(std::span<const BuildRef> refs, std::span<const uint64_t> codes, BinaryNode* nodes)
      : refs_(refs), codes_(codes), nodes_(nodes) {}

  LaneBox build(uint32_t begin, uint32_t end, uint32_t depth, uint32_t index) {
    const uint32_t count = end - begin;
    LaneBox box;
    uint32_t left = kNoIndex;
    if (count == 1) {
      box = {lanes_load3(refs_[begin].lo), lanes_load3(refs_[begin].hi)};
    } else {
      const uint32_t split = find_split(begin, end, depth);
      left = 2 * split - 1;
      LaneBox right_box;
      const auto build_left = [&] { box = build(begin, split, depth + 1, left); };
      const auto build_right = [&] { right_box = build(split, end, depth + 1, left + 1); };
      if (count > kSerialRefs) {
        tbb::parallel_invoke(build_left, build_right);
      } else {
        build_left(), build_right();
      }
      box.include(right_box);
    }
    const Bounds3 b = box.bounds();
    nodes_[index] = {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}, begin, count, left, 0};
    return box;
  }

 private:
  /// The first reference of the right side. Requires: two references at least.
  uint32_t find_split(uint32_t begin, uint32_t end, uint32_t depth) const {
    const uint32_t count = end - begin, last = end - 1;
    if (depth + static_cast<uint32_t>(std::bit_width(count - 1)) >= kMaxBinaryDepth) return begin + (count + 1) / 2;
    if (codes_[begin] == codes_[last]) {
      const int shift = std::bit_width(begin ^ last) - 1;
      return last >> shift << shift;
    }
    const uint64_t bit = std::bit_floor(codes_[begin] ^ codes_[last]);
    const auto right = std::partition_point(codes_.begin() + begin, codes_.begin() + end,
                                            [bit](uint64_t code) { return (code & bit) == 0; });
    return static_cast<uint32_t>(right - codes_.begin());
  }

  std::span<const BuildRef> refs_;
  std::span<const uint64_t> codes_;
  BinaryNode* nodes_;
};

}  // namespace

FullTree build_radix_tree(std::span<BuildRef> refs) {
  const std::vector<uint64_t> codes = order_along_curve(refs);
  FullTree tree(refs.size());
  RadixTreeBuilder(refs, codes, tree.nodes.data()).build(0, static_cast<uint32_t>(refs.size()), 0, 0);
  return tree;
}

std::vector<BinaryNode> build_linear_bvh(std::span<BuildRef> refs, const SahModel& model) {
  return close_leaves(build_radix_tree(refs), refs, model);
}

}  // namespace shoal
