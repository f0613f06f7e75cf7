#include "treelets/restructured_bvh.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "treelets/collapse_wide.h"
#include "treelets/linear_bvh.h"

namespace shoal {
namespace {

using Subset = uint32_t;  // of the leaves of a patch
constexpr Subset kAllLeaves = (1u << kPatchLeaves) - 1;

/// While the tree is restructured, `bytes` holds the bits of a subtree's cost over the root's area, and `first` the
/// height of a node that is no leaf.
float cost_of(const BinaryNode& node) { return std::bit_cast<float>(node.bytes); }
void set_cost(BinaryNode& node, double cost) { node.bytes = std::bit_cast<uint32_t>(static_cast<float>(cost)); }
uint32_t height_of(const BinaryNode& node) { return node.leaf() ? 0 : node.first; }

/// The best way to join the subtrees at the leaves of a patch.
class PatchPlan {
 public:
  PatchPlan(const BinaryNode* leaves, const RestructureModel& model, double per_area) {
    for (Subset s = 1; s <= kAllLeaves; ++s) {
      const Subset rest = s & (s - 1);
      const BinaryNode& leaf = leaves[std::countr_zero(s)];
      const LaneBox box{lanes_load_unaligned(leaf.lo),
                        lanes_load_unaligned(leaf.hi)};  // what follows lo is hi: unused
      box_[s] = box;
      if (rest == 0) {
        cost_[s] = cost_of(leaf), count_[s] = leaf.count;
        continue;
      }
      box_[s].include(box_[rest]);
      count_[s] = count_[s ^ rest] + count_[rest];
      const double area = half_area(box_[s]) * per_area;
      const double opened = model.node_cost * area + cheapest_split(s, rest);
      cost_[s] = static_cast<float>(std::min(opened, model.triangle_cost * area * count_[s]));
    }
  }

  float cost(Subset s) const { return cost_[s]; }
  /// One of the two sides that a subset is cut into.
  Subset left(Subset s) const { return left_[s]; }
  uint32_t count(Subset s) const { return count_[s]; }
  Bounds3 box(Subset s) const { return box_[s].bounds(); }

 private:
  /// Over all cuts of `s`; the leaf that `rest` lacks is always on the left, so each is met once.
  double cheapest_split(Subset s, Subset rest) {
    const Subset first = s ^ rest;
    float cheapest = std::numeric_limits<float>::infinity();
    Subset best = first;
    for (Subset right = rest; right != 0; right = (right - 1) & rest) {
      const float sum = cost_[s ^ right] + cost_[right];
      if (sum < cheapest) cheapest = sum, best = s ^ right;
    }
    left_[s] = static_cast<uint8_t>(best);
    return cheapest;
  }

  LaneBox box_[kAllLeaves + 1];
  float cost_[kAllLeaves + 1];
  uint32_t count_[kAllLeaves + 1];
  uint8_t left_[kAllLeaves + 1];
};

class Restructurer {
 public:
  Restructurer(BinaryNode* nodes, const RestructureModel& model) : nodes_(nodes), model_(model) {
    const double area = half_area(nodes_[0]);
    per_area_ =
        area > std::numeric_limits<double>::min() * 16 ? 1 / area : 0;  // without area nothing costs anything
  }

  void run() {
    measure(0);
    uint32_t least = std::max(model_.least_refs, kPatchLeaves);
    for (uint32_t round = 0; round < model_.rounds && least <= nodes_[0].count; ++round, least *= 2)
      visit(0, 0, least);
  }

 private:
  template <class F>
  void for_both(const BinaryNode& node, const F& f) {
    if (node.count > kSerialRefs) {
      tbb::parallel_invoke([&] { f(node.left); }, [&] { f(node.left + 1); });
    } else {
      f(node.left), f(node.left + 1);
    }
  }

  void update(BinaryNode& node) {
    const double area = half_area(node) * per_area_;
    const BinaryNode &left = nodes_[node.left], &right = nodes_[node.left + 1];
    node.first = 1 + std::max(height_of(left), height_of(right));
    const double opened = model_.node_cost * area + (cost_of(left) + cost_of(right));
    set_cost(node, std::min(opened, model_.triangle_cost * area * node.count));
  }

  void measure(uint32_t index) {
    BinaryNode& node = nodes_[index];
    if (node.leaf()) {
      set_cost(node, model_.triangle_cost * half_area(node) * per_area_);
      return;
    }
    for_both(node, [this](uint32_t child) { measure(child); });
    update(node);
  }

  void visit(uint32_t index, uint32_t depth, uint32_t least) {
    BinaryNode& node = nodes_[index];
    if (node.count < least) return;
    for_both(node, [&](uint32_t child) { visit(child, depth + 1, least); });
    update(node);
    improve(node, depth);
  }

  struct Patch {
    BinaryNode leaves[kPatchLeaves];
    uint32_t pairs[kPatchLeaves - 1];  // where the nodes between the root and the leaves lie, two by two
    uint32_t pair_count = 0;
  };

  /// Opens the largest leaf until there are enough.
  Patch form(const BinaryNode& root) const {
    Patch patch;
    uint32_t leaf_count = 0;
    double area[kPatchLeaves];  // below 0: cannot be opened
    const auto put = [&](uint32_t place, uint32_t index) {
      patch.leaves[place] = nodes_[index];
      area[place] = nodes_[index].leaf() ? -1 : half_area(nodes_[index]);
    };
    const auto open = [&](uint32_t place, uint32_t left) {
      patch.pairs[patch.pair_count++] = left;
      put(place, left), put(leaf_count++, left + 1);
    };
    leaf_count = 1;
    open(0, root.left);
    while (leaf_count < kPatchLeaves) {
      const auto largest = static_cast<uint32_t>(std::max_element(area, area + leaf_count) - area);
      open(largest, patch.leaves[largest].left);
    }
    return patch;
  }

  void improve(BinaryNode& root, uint32_t depth) {
    Patch patch = form(root);
    const PatchPlan plan(patch.leaves, model_, per_area_);
    if (!(plan.cost(kAllLeaves) < cost_of(root))) return;
    if (depth + height(plan, patch, kAllLeaves) > kMaxBinaryDepth) return;
    patch.pair_count = 0;
    join(plan, patch, kAllLeaves, root);
  }

  static uint32_t height(const PatchPlan& plan, const Patch& patch, Subset s) {
    if (std::has_single_bit(s)) return height_of(patch.leaves[std::countr_zero(s)]);
    return 1 + std::max(height(plan, patch, plan.left(s)), height(plan, patch, s ^ plan.left(s)));
  }

  /// Puts the subtree over `s` at `node`; pairs are used up in order.
  void join(const PatchPlan& plan, Patch& patch, Subset s, BinaryNode& node) {
    if (std::has_single_bit(s)) {
      node = patch.leaves[std::countr_zero(s)];
      return;
    }
    const uint32_t pair = patch.pairs[patch.pair_count++];
    join(plan, patch, plan.left(s), nodes_[pair]);
    join(plan, patch, s ^ plan.left(s), nodes_[pair + 1]);
    const Bounds3 b = plan.box(s);
    node = {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}, 0, plan.count(s), pair, 0};
    node.first = 1 + std::max(height_of(nodes_[pair]), height_of(nodes_[pair + 1]));
    set_cost(node, plan.cost(s));
  }

  BinaryNode* nodes_;
  const RestructureModel model_;
  double per_area_;
};

}  // namespace

void restructure(FullTree& tree, const RestructureModel& model) { Restructurer(tree.nodes.data(), model).run(); }

std::vector<BinaryNode> build_restructured_bvh(std::span<BuildRef> refs, const SahModel& model) {
  FullTree tree = build_radix_tree(refs);
  restructure(tree);
  return close_leaves(std::move(tree), refs, model);
}

}  // namespace shoal
