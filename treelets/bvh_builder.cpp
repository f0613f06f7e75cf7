#include "treelets/bvh_builder.h"

#include "treelets/full_tree.h"
#include "treelets/linear_bvh.h"
#include "treelets/restructured_bvh.h"

namespace shoal {

std::vector<BinaryNode> build_tree(BvhBuilder builder, std::span<BuildRef> refs, const SahModel& model) {
  switch (builder) {
    case BvhBuilder::kSah:
      return build_binary_tree(refs, model);
    case BvhBuilder::kLbvh:
      return build_linear_bvh(refs, model);
    case BvhBuilder::kKarras:
      return build_restructured_bvh(refs, model);
  }
  return {};
}

uint64_t builder_scratch_bytes(BvhBuilder builder) {
  // The full tree (of lbvh: the subtrees that are copied into one array, at most as large), the codes along the curve
  // or the order of the leaves beside it. Keys and the copies that references are reordered through
  // (treelets/morton_order, treelets/full_tree) come before it and after it, and are smaller.
  return builder == BvhBuilder::kSah ? 0 : FullTree::kBytesPerRef + sizeof(uint64_t);
}

}  // namespace shoal
