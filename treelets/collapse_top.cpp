#include "treelets/collapse_top.h"

#include "treelets/collapse_wide.h"

namespace shoal {
namespace {

TopNode empty_node(uint32_t parent, uint32_t level) {
  TopNode node{};
  for (int axis = 0; axis < 3; ++axis) {
    std::fill_n(node.lo[axis], 8, std::numeric_limits<float>::infinity());
    std::fill_n(node.hi[axis], 8, -std::numeric_limits<float>::infinity());
  }
  node.parent = parent;
  node.level = level;
  return node;
}

class TopCollapser {
 public:
  TopCollapser(std::span<const BinaryNode> tree, std::span<const uint32_t> leaf_index, ChildKind kind)
      : tree_(tree), leaf_index_(leaf_index), plan_(tree, leaf_index), kind_(kind) {}

  std::vector<TopNode> collapse() {
    WideChildren root;
    if (leaf_index_[0] != kNoIndex) root.node[root.count++] = 0;
    add_node(root.count == 1 ? root : plan_.children(0), kNoIndex, 0);
    return std::move(nodes_);
  }

 private:
  uint32_t add_node(const WideChildren& children, uint32_t parent, uint32_t level) {
    const uint32_t index = static_cast<uint32_t>(nodes_.size());
    nodes_.push_back(empty_node(parent, level));
    for (uint32_t slot = 0; slot < children.count; ++slot) {
      const uint32_t child = children.node[slot];
      const bool leads_out = leaf_index_[child] != kNoIndex;
      const uint32_t target =
          leads_out ? leaf_index_[child] : add_node(plan_.children(child), index << 3 | slot, level + 1);
      TopNode& node = nodes_[index];
      for (int axis = 0; axis < 3; ++axis) {
        node.lo[axis][slot] = tree_[child].lo[axis];
        node.hi[axis][slot] = tree_[child].hi[axis];
      }
      node.child[slot] = target;
      node.kind[slot] = leads_out ? kind_ : ChildKind::kNode;
    }
    return index;
  }

  std::span<const BinaryNode> tree_;
  std::span<const uint32_t> leaf_index_;
  WidePlan plan_;
  ChildKind kind_;
  std::vector<TopNode> nodes_;
};

}  // namespace

std::vector<TopNode> collapse_top(std::span<const BinaryNode> tree, std::span<const uint32_t> leaf_index,
                                  ChildKind kind) {
  return TopCollapser(tree, leaf_index, kind).collapse();
}

}  // namespace shoal
