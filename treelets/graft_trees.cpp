#include "treelets/graft_trees.h"

#include <algorithm>

namespace shoal {
namespace {

class Grafter {
 public:
  Grafter(std::span<const PartNode> parts, const UpperForest& forest) : parts_(parts), forest_(forest) {}

  std::vector<BinaryNode> graft() {
    nodes_.reserve(forest_.nodes.size() + parts_.size());
    nodes_.resize(1);
    place(0, 0);
    return std::move(nodes_);
  }

 private:
  void place(uint32_t part, size_t index) {
    if (parts_[part].left == kNoIndex) {
      copy_subtree(forest_.nodes, forest_.roots[parts_[part].part], nodes_, index, [this](uint32_t node) {
        return forest_.nodes[node].leaf() ? forest_.nodes[node].first : kNoIndex;
      });
      return;
    }
    const size_t child = nodes_.size();
    nodes_.resize(child + 2);
    for (uint32_t i = 0; i < 2; ++i) place(parts_[part].left + i, child + i);
    BinaryNode& node = nodes_[index];
    const BinaryNode &left = nodes_[child], &right = nodes_[child + 1];
    node = {{}, {}, 0, left.count + right.count, static_cast<uint32_t>(child), 0};
    for (int axis = 0; axis < 3; ++axis) {
      node.lo[axis] = std::min(left.lo[axis], right.lo[axis]);
      node.hi[axis] = std::max(left.hi[axis], right.hi[axis]);
    }
  }

  std::span<const PartNode> parts_;
  const UpperForest& forest_;
  std::vector<BinaryNode> nodes_;
};

}  // namespace

std::vector<BinaryNode> graft_trees(std::span<const PartNode> parts, const UpperForest& forest) {
  return Grafter(parts, forest).graft();
}

}  // namespace shoal
