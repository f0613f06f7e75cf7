#include "treelets/binned_sah.h"
#include "treelets/build_object.h"
#include "treelets/collapse_top.h"

namespace shoal {
namespace {

// Finite, with one zero; what is not a number becomes as wide as it can be.
BuildRef make_ref(const InstanceBounds& instance) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  BuildRef ref{};
  ref.id = instance.instance;
  for (int axis = 0; axis < 3; ++axis) {
    const float lo = instance.bounds.lo[axis], hi = instance.bounds.hi[axis];
    ref.lo[axis] = lo >= -kLargest ? std::min(lo, kLargest) + 0.0f : -kLargest;
    ref.hi[axis] = hi <= kLargest ? std::max(hi, -kLargest) + 0.0f : kLargest;
  }
  return ref;
}

}  // namespace

std::vector<TopNode> build_instance_tree(std::span<const InstanceBounds> instances) {
  std::vector<BuildRef> refs;
  refs.reserve(instances.size());
  for (const InstanceBounds& instance : instances) {
    const Vec3 &lo = instance.bounds.lo, &hi = instance.bounds.hi;
    if (!(lo.x > hi.x || lo.y > hi.y || lo.z > hi.z)) refs.push_back(make_ref(instance));
  }
  if (refs.empty()) {
    // One node without children, from the same hand as the others.
    constexpr float kInf = std::numeric_limits<float>::infinity();
    const BinaryNode nothing{{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}, 0, 0, kNoIndex, 0};
    const uint32_t leads_to = 0;
    return collapse_top({&nothing, 1}, {&leads_to, 1}, ChildKind::kEmpty);
  }
  const std::vector<BinaryNode> tree = build_binary_tree(refs, {1});
  std::vector<uint32_t> leaf_index(tree.size(), kNoIndex);
  for (size_t i = 0; i < tree.size(); ++i) {
    if (tree[i].leaf()) leaf_index[i] = refs[tree[i].first].id;
  }
  return collapse_top(tree, leaf_index, ChildKind::kInstance);
}

}  // namespace shoal
