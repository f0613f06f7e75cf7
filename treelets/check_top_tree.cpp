#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "treelets/top_tree.h"

namespace shoal {
namespace {

Error corrupt(std::string message) { return {ErrorCode::kCorrupt, "top tree: " + std::move(message)}; }

struct Tables {
  std::span<const TopNode> nodes;
  std::span<const TreeletEntry> entries;
  std::span<const Instance> instances;
};

bool is_finite(const Affine3& m) {
  const float* v = &m.column_x.x;
  for (int i = 0; i < 12; ++i) {
    if (!std::isfinite(v[i])) return false;
  }
  return true;
}

Status check_instance(const Tables& tables, uint32_t index) {
  const Instance& instance = tables.instances[index];
  const uint64_t node = instance.tree_child >> 3;
  if (instance.root_node == 0 || instance.root_node >= tables.nodes.size() || node >= tables.nodes.size()) {
    return corrupt(fmt::format("instance {} names nodes {} and {} of {}", index, instance.root_node, node,
                               tables.nodes.size()));
  }
  const TopNode& above = tables.nodes[node];
  const uint32_t slot = instance.tree_child & 7;
  if (above.kind[slot] != ChildKind::kInstance || above.child[slot] != index) {
    return corrupt(fmt::format("instance {} is not the child {} of node {}", index, slot, node));
  }
  if (tables.nodes[instance.root_node].parent != kNoIndex) {
    return corrupt(fmt::format("instance {}: node {} is not a root", index, instance.root_node));
  }
  return {};
}

Status check_finite(const Instance& row, uint32_t index) {
  if (is_finite(row.object_to_world) && is_finite(row.world_to_object) && row.identity <= 1 &&
      std::isfinite(row.transform_error) && std::isfinite(row.max_abs_coordinate)) {
    return {};
  }
  return corrupt(fmt::format("instance {} has numbers that are not finite or flags that are not 0 or 1", index));
}

/// The keys of an instance lie behind all instances.
Status check_motion(const Tables& tables, uint32_t index, size_t count) {
  const Instance& instance = tables.instances[index];
  if (instance.motion_rows == 0 && instance.key_count == 0) return {};
  const uint64_t first = uint64_t{index} + instance.motion_rows;
  if (first >= count && instance.key_count >= 2 && instance.identity == 0 &&
      first + instance.key_count <= tables.instances.size()) {
    return {};
  }
  return corrupt(fmt::format("instance {} has {} keys from row {}: expected 2 at least in rows {} to {}", index,
                             instance.key_count, first, count, tables.instances.size()));
}

/// One child's link, box and kind. `wanted` is the kind of leaf that this tree may have.
Status check_child(const Tables& tables, uint32_t index, uint32_t slot, ChildKind wanted) {
  const TopNode& node = tables.nodes[index];
  const ChildKind kind = node.kind[slot];
  if (kind == ChildKind::kEmpty) return {};
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(node.lo[axis][slot]) || !std::isfinite(node.hi[axis][slot])) {
      return corrupt(fmt::format("node {}, child {}: its box is not finite", index, slot));
    }
  }
  const uint32_t child = node.child[slot];
  const size_t limit = kind == ChildKind::kNode    ? tables.nodes.size()
                       : kind == ChildKind::kEntry ? tables.entries.size()
                                                   : tables.instances.size();
  if ((kind != ChildKind::kNode && kind != wanted) || child >= limit) {
    return corrupt(fmt::format("node {}, child {}: kind {}, index {} of {}", index, slot, static_cast<int>(kind),
                               child, limit));
  }
  if (kind == ChildKind::kInstance && tables.instances[child].tree_child != (index << 3 | slot)) {
    return corrupt(fmt::format("node {}, child {}: instance {} has another parent", index, slot, child));
  }
  if (kind == ChildKind::kNode &&
      (tables.nodes[child].parent != (index << 3 | slot) || tables.nodes[child].level != node.level + 1)) {
    return corrupt(fmt::format("node {}, child {}: node {} has another parent or level", index, slot, child));
  }
  return {};
}

/// Every node below `root`. Parent links give each node one parent, so the walk ends.
Status check_tree(const Tables& tables, uint32_t root, ChildKind wanted) {
  if (tables.nodes[root].parent != kNoIndex || tables.nodes[root].level != 0) {
    return corrupt(fmt::format("node {} is not a root of level 0", root));
  }
  std::vector<uint32_t> stack{root};
  while (!stack.empty()) {
    const uint32_t index = stack.back();
    stack.pop_back();
    for (uint32_t slot = 0; slot < 8; ++slot) {
      SHOAL_RETURN_IF_ERROR(check_child(tables, index, slot, wanted));
      if (tables.nodes[index].kind[slot] == ChildKind::kNode) stack.push_back(tables.nodes[index].child[slot]);
    }
  }
  return {};
}

}  // namespace

Status TopTree::check(std::span<const TopNode> nodes, std::span<const TreeletEntry> entries,
                      std::span<const Instance> rows, uint32_t treelet_count) {
  size_t count = 0;
  while (count < rows.size() && rows[count].tree_child != kNoIndex) ++count;
  const std::span<const Instance> instances = rows.first(count);
  for (uint32_t i = 0; i < rows.size(); ++i) SHOAL_RETURN_IF_ERROR(check_finite(rows[i], i));
  if (count == 0 && !rows.empty()) return corrupt(fmt::format("{} keys without an instance", rows.size()));
  for (uint32_t i = static_cast<uint32_t>(count); i < rows.size(); ++i) {
    const bool key = rows[i].tree_child == kNoIndex && !rows[i].moves() && rows[i].key_count <= 1;
    if (!key) return corrupt(fmt::format("row {} of the instances, behind the first key, is no key", i));
  }
  for (uint32_t i = 0; i < count; ++i) SHOAL_RETURN_IF_ERROR(check_motion({nodes, entries, rows}, i, count));
  const Tables tables{nodes, entries, instances};
  if (nodes.size() >= 1u << 29 || entries.size() >= kNoIndex || instances.size() >= kNoIndex) {
    return corrupt(fmt::format("{} nodes, {} entries and {} instances are too many", nodes.size(), entries.size(),
                               instances.size()));
  }
  if (nodes.empty()) {
    return instances.empty() ? Status() : corrupt(fmt::format("{} instances without a tree", instances.size()));
  }
  for (size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].treelet >= treelet_count) {
      return corrupt(fmt::format("entry {} names treelet {} of {}", i, entries[i].treelet, treelet_count));
    }
  }
  for (uint32_t i = 0; i < instances.size(); ++i) SHOAL_RETURN_IF_ERROR(check_instance(tables, i));
  SHOAL_RETURN_IF_ERROR(check_tree(tables, 0, ChildKind::kInstance));
  std::vector<uint8_t> checked(nodes.size(), 0);
  for (const Instance& instance : instances) {
    if (checked[instance.root_node]) continue;
    checked[instance.root_node] = 1;
    SHOAL_RETURN_IF_ERROR(check_tree(tables, instance.root_node, ChildKind::kEntry));
  }
  return {};
}

}  // namespace shoal
