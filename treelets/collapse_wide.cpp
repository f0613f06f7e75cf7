#include "treelets/collapse_wide.h"

namespace shoal {

uint32_t count_wide_nodes(std::span<const BinaryNode> tree, uint32_t root) {
  if (tree[root].leaf()) return 0;
  uint32_t count = 1;
  const WideChildren children = open_children(tree, root);
  for (uint32_t i = 0; i < children.count; ++i) count += count_wide_nodes(tree, children.node[i]);
  return count;
}

}  // namespace shoal
