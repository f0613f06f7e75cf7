#include "treelets/linear_bvh.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <bit>
#include <utility>

#include "treelets/morton_order.h"
#include "treelets/sah_bins.h"

namespace shoal {
namespace {

/// The first reference of the right side of [begin, end), a node at `depth`. Requires: two references at least.
uint32_t find_split(std::span<const uint64_t> codes, uint32_t begin, uint32_t end, uint32_t depth) {
  const uint32_t count = end - begin, last = end - 1;
  if (depth + static_cast<uint32_t>(std::bit_width(count - 1)) >= kMaxBinaryDepth) return begin + (count + 1) / 2;
  if (codes[begin] == codes[last]) {
    const int shift = std::bit_width(begin ^ last) - 1;
    return last >> shift << shift;
  }
  const uint64_t bit = std::bit_floor(codes[begin] ^ codes[last]);
  const auto right = std::partition_point(codes.begin() + begin, codes.begin() + end,
                                          [bit](uint64_t code) { return (code & bit) == 0; });
  return static_cast<uint32_t>(right - codes.begin());
}

BinaryNode make_node(const LaneBox& box, uint32_t first, uint32_t count, uint32_t left) {
  const Bounds3 b = box.bounds();
  return {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}, first, count, left, 0};
}

LaneBox box_of(const BuildRef& ref) { return {lanes_load3(ref.lo), lanes_load3(ref.hi)}; }

/// Writes the children of the node whose left side ends at `split - 1` to 2 * split - 1 and 2 * split: a place that no
/// other node of the tree has, as in Karras 2012, so that subtrees need not know of each other.
class RadixTreeBuilder {
 public:
  RadixTreeBuilder(std::span<const BuildRef> refs, std::span<const uint64_t> codes, BinaryNode* nodes)
      : refs_(refs), codes_(codes), nodes_(nodes) {}

  LaneBox build(uint32_t begin, uint32_t end, uint32_t depth, uint32_t index) {
    const uint32_t count = end - begin;
    LaneBox box;
    uint32_t left = kNoIndex;
    if (count == 1) {
      box = box_of(refs_[begin]);
    } else {
      const uint32_t split = find_split(codes_, begin, end, depth);
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
    nodes_[index] = make_node(box, begin, count, left);
    return box;
  }

 private:
  std::span<const BuildRef> refs_;
  std::span<const uint64_t> codes_;
  BinaryNode* nodes_;
};

/// The same tree with its leaves closed on the way, so that what lies below them is never stored: the top is split first,
/// down to runs of a task's size, then the subtrees over these are built at once and copied behind it.
class ClosedTreeBuilder {
 public:
  ClosedTreeBuilder(std::span<const BuildRef> refs, std::span<const uint64_t> codes, const SahModel& model)
      : refs_(refs), codes_(codes), model_(model) {}

  std::vector<BinaryNode> build() {
    nodes_.resize(1);
    split_top(0, static_cast<uint32_t>(refs_.size()), 0, 0);
    const auto top_count = static_cast<uint32_t>(nodes_.size());
    tbb::parallel_for(size_t{0}, runs_.size(), [&](size_t i) {
      Run& run = runs_[i];
      run.nodes.resize(1);
      build_closed(run.begin, run.end, run.depth, 0, run.nodes);
    });
    uint32_t next = top_count;
    for (Run& run : runs_) run.first_node = std::exchange(next, next + static_cast<uint32_t>(run.nodes.size()) - 1);
    nodes_.resize(next);
    tbb::parallel_for(size_t{0}, runs_.size(), [&](size_t i) { place(runs_[i]); });
    for (uint32_t i = top_count; i-- > 0;) {
      if (nodes_[i].left < top_count) join(nodes_[i]);  // else it is the root of a run
    }
    return std::move(nodes_);
  }

 private:
  struct Run {
    uint32_t begin, end, depth, root;  ///< its root is nodes_[root]
    uint32_t first_node = 0;           ///< the rest comes from here on
    std::vector<BinaryNode> nodes;     ///< the root first
  };
  struct Closed {
    LaneBox box;
    double cost;  ///< of few references: by the model
  };

  double tests(uint32_t count) const {
    return static_cast<double>((uint64_t{count} + model_.block - 1) / model_.block);
  }

  void split_top(uint32_t begin, uint32_t end, uint32_t depth, uint32_t index) {
    if (end - begin <= kSerialRefs) {
      runs_.push_back({begin, end, depth, index, 0, {}});
      return;
    }
    const auto child = static_cast<uint32_t>(nodes_.size());
    nodes_.resize(child + 2);
    nodes_[index] = make_node({}, begin, end - begin, child);
    const uint32_t split = find_split(codes_, begin, end, depth);
    split_top(begin, split, depth + 1, child);
    split_top(split, end, depth + 1, child + 1);
  }

  Closed build_closed(uint32_t begin, uint32_t end, uint32_t depth, size_t index, std::vector<BinaryNode>& nodes) {
    const uint32_t count = end - begin;
    if (count == 1) {
      const LaneBox box = box_of(refs_[begin]);
      nodes[index] = make_node(box, begin, 1, kNoIndex);
      return {box, half_area(box)};
    }
    const size_t child = nodes.size();
    nodes.resize(child + 2);
    const uint32_t split = find_split(codes_, begin, end, depth);
    Closed built = build_closed(begin, split, depth + 1, child, nodes);
    const Closed right = build_closed(split, end, depth + 1, child + 1, nodes);
    built.box.include(right.box);
    built.cost += right.cost;
    auto left = static_cast<uint32_t>(child);
    if (count <= model_.leaf_size) {
      const double area = half_area(built.box), leaf_cost = area * tests(count);
      built.cost += model_.split_cost * area;
      if (built.cost >= leaf_cost) {
        built.cost = leaf_cost, left = kNoIndex;
        nodes.resize(child);
      }
    }
    nodes[index] = make_node(built.box, begin, count, left);
    return built;
  }

  void place(Run& run) {
    const uint32_t shift = run.first_node - 1;
    for (size_t i = 0; i < run.nodes.size(); ++i) {
      BinaryNode node = run.nodes[i];
      if (!node.leaf()) node.left += shift;
      nodes_[i == 0 ? run.root : shift + i] = node;
    }
    run.nodes = {};
  }

  void join(BinaryNode& node) const {
    const BinaryNode &left = nodes_[node.left], &right = nodes_[node.left + 1];
    for (int axis = 0; axis < 3; ++axis) {
      node.lo[axis] = std::min(left.lo[axis], right.lo[axis]);
      node.hi[axis] = std::max(left.hi[axis], right.hi[axis]);
    }
  }

  std::span<const BuildRef> refs_;
  std::span<const uint64_t> codes_;
  SahModel model_;
  std::vector<BinaryNode> nodes_;
  std::vector<Run> runs_;
};

}  // namespace

FullTree build_radix_tree(std::span<BuildRef> refs) {
  const std::vector<uint64_t> codes = order_along_curve(refs);
  FullTree tree(refs.size());
  RadixTreeBuilder(refs, codes, tree.nodes.data()).build(0, static_cast<uint32_t>(refs.size()), 0, 0);
  return tree;
}

std::vector<BinaryNode> build_linear_bvh(std::span<BuildRef> refs, const SahModel& model) {
  const std::vector<uint64_t> codes = order_along_curve(refs);
  return ClosedTreeBuilder(refs, codes, model).build();
}

}  // namespace shoal
