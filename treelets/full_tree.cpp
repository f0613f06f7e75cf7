#include "treelets/full_tree.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>

#include "treelets/collapse_wide.h"

namespace shoal {
namespace {

/// BinaryNode::bytes is, once closed, how many nodes come out of a subtree; 1: a leaf.
class LeafCloser {
 public:
  LeafCloser(std::span<BinaryNode> nodes, const SahModel& model) : nodes_(nodes), model_(model) {}

  void close() { close_large(0); }

  std::vector<BinaryNode> emit(std::vector<uint32_t>& order) {
    out_.resize(nodes_[0].bytes);
    order_ = order;
    emit(0, 0, 1, 0);
    return std::move(out_);
  }

 private:
  double tests(uint32_t count) const {
    return static_cast<double>((uint64_t{count} + model_.block - 1) / model_.block);
  }

  void count_nodes(BinaryNode& node) { node.bytes = 1 + nodes_[node.left].bytes + nodes_[node.left + 1].bytes; }

  void close_large(uint32_t index) {
    BinaryNode& node = nodes_[index];
    if (node.count <= model_.leaf_size) {
      close_small(index);
      return;
    }
    if (node.count > kSerialRefs) {
      tbb::parallel_invoke([&] { close_large(node.left); }, [&] { close_large(node.left + 1); });
    } else {
      close_large(node.left), close_large(node.left + 1);
    }
    count_nodes(node);
  }

  /// Returns what the subtree costs.
  double close_small(uint32_t index) {
    BinaryNode& node = nodes_[index];
    const double area = half_area(node), leaf_cost = area * tests(node.count);
    node.bytes = 1;
    if (node.leaf()) return leaf_cost;
    const double left_cost = close_small(node.left), right_cost = close_small(node.left + 1);
    const double split_cost = model_.split_cost * area + left_cost + right_cost;
    if (split_cost >= leaf_cost) return leaf_cost;
    count_nodes(node);
    return split_cost;
  }

  /// Writes the subtree's root at `place`, all below from `next` on; its references come from `first` on.
  void emit(uint32_t index, uint32_t place, uint32_t next, uint32_t first) {
    const BinaryNode& node = nodes_[index];
    out_[place] = node;
    out_[place].first = first;
    out_[place].bytes = 0;
    if (node.bytes == 1) {
      out_[place].left = kNoIndex;
      gather(index, first);
      return;
    }
    out_[place].left = next;
    const BinaryNode& left = nodes_[node.left];
    const auto emit_left = [&] { emit(node.left, next, next + 2, first); };
    const auto emit_right = [&] { emit(node.left + 1, next + 1, next + 1 + left.bytes, first + left.count); };
    if (node.count > kSerialRefs) {
      tbb::parallel_invoke(emit_left, emit_right);
    } else {
      emit_left(), emit_right();
    }
  }

  /// Returns the place after the last reference.
  uint32_t gather(uint32_t index, uint32_t first) {
    const BinaryNode& node = nodes_[index];
    if (node.leaf()) {
      order_[first] = node.first;
      return first + 1;
    }
    return gather(node.left + 1, gather(node.left, first));
  }

  std::span<BinaryNode> nodes_;
  SahModel model_;
  std::vector<BinaryNode> out_;
  std::span<uint32_t> order_;
};

}  // namespace

std::vector<BinaryNode> close_leaves(FullTree&& tree, std::span<BuildRef> refs, const SahModel& model) {
  std::vector<uint32_t> order(refs.size());
  std::vector<BinaryNode> closed;
  {
    const FullTree full = std::move(tree);  // gone before the references are copied
    LeafCloser closer({full.nodes.data(), 2 * full.ref_count - 1}, model);
    closer.close();
    closed = closer.emit(order);
  }
  const HugeArray<BuildRef> copy(refs.size());
  tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) { copy[i] = refs[i]; });
  tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) { refs[i] = copy[order[i]]; });
  return closed;
}

}  // namespace shoal
