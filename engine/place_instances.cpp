#include "engine/place_instances.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace shoal {

namespace {

constexpr uint64_t kMaxTopNodes = 1u << 29;  // a cursor is node << 3 | slot

double max_abs(const Bounds3& b) {
  double largest = 0;
  for (int i = 0; i < 3; ++i) {
    largest = std::max({largest, std::abs(double{b.lo[i]}), std::abs(double{b.hi[i]})});
  }
  return largest;
}

/// The world box of an object's box through `map`. The ray meets the object through the rounded inverse: a relative
/// error of 2^-24 in its elements moves the object by about K * 2^-24 of its world coordinates an element, four
/// elements a coordinate; 2^-21 leaves a factor of two for the sums.
Bounds3 world_bounds(const Bounds3& object, const AffineDouble& map, double error_growth) {
  double lo[3], hi[3], largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    lo[axis] = hi[axis] = map.translation[axis];
    double reach = std::abs(map.translation[axis]);
    for (int c = 0; c < 3; ++c) {
      const double a = map.column[c][axis] * object.lo[c], b = map.column[c][axis] * object.hi[c];
      lo[axis] += std::min(a, b), hi[axis] += std::max(a, b);
      reach += std::max(std::abs(a), std::abs(b));
    }
    largest = std::max(largest, reach);
  }
  const double pad = largest * error_growth * 0x1p-21;
  Bounds3 world;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    world.lo[axis] = std::nextafter(static_cast<float>(lo[axis] - pad), -kInfinity);
    world.hi[axis] = std::nextafter(static_cast<float>(hi[axis] + pad), kInfinity);
  }
  return world;
}

bool finite(const Bounds3& b) {
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(b.lo[i]) || !std::isfinite(b.hi[i])) return false;
  }
  return true;
}

void append_object(const BuiltObject& object, TopTables& tables) {
  const auto node_base = static_cast<uint32_t>(tables.nodes.size());
  const auto entry_base = static_cast<uint32_t>(tables.entries.size());
  for (TopNode node : object.nodes) {
    if (node.parent != kNoIndex) node.parent += node_base << 3;
    for (int slot = 0; slot < 8; ++slot) {
      if (node.kind[slot] == ChildKind::kNode) node.child[slot] += node_base;
      if (node.kind[slot] == ChildKind::kEntry) node.child[slot] += entry_base;
    }
    tables.nodes.push_back(node);
  }
  tables.entries.insert(tables.entries.end(), object.entries.begin(), object.entries.end());
}

}  // namespace

std::optional<PlacedInstance> place_instance(uint32_t object, const Bounds3& object_bounds,
                                             const AffineDouble& to_world) {
  PlacedInstance placed = {};
  Instance& instance = placed.instance;
  instance.object = object;
  instance.object_to_world = rounded(to_world);
  instance.identity = instance.object_to_world == Affine3{} ? 1 : 0;
  instance.max_abs_coordinate = static_cast<float>(max_abs(object_bounds));
  if (instance.identity) {
    instance.transform_error = 1;
    placed.bounds = object_bounds;
    return placed;
  }
  const AffineDouble map = widened(instance.object_to_world);
  if (determinant(map) == 0) return std::nullopt;
  const AffineDouble back = inverse(map);
  instance.world_to_object = rounded(back);
  const double growth = absolute_row_sum(map, back);
  instance.transform_error = static_cast<float>(growth);
  placed.bounds = world_bounds(object_bounds, map, growth);
  const bool usable = finite(back) && finite(widened(instance.world_to_object)) &&
                      std::isfinite(instance.transform_error) && finite(placed.bounds);
  if (!usable || determinant(widened(instance.world_to_object)) == 0) return std::nullopt;
  return placed;
}

Result<TopTables> assemble_top_tree(std::span<const BuiltObject> objects, std::vector<PlacedInstance> placed) {
  TopTables tables;
  std::vector<InstanceBounds> bounds;
  for (uint32_t i = 0; i < placed.size(); ++i) bounds.push_back({i, placed[i].bounds});
  tables.nodes = build_instance_tree(bounds);
  for (PlacedInstance& p : placed) tables.instances.push_back(p.instance);
  for (uint32_t node = 0; node < tables.nodes.size(); ++node) {
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (tables.nodes[node].kind[slot] != ChildKind::kInstance) continue;
      tables.instances[tables.nodes[node].child[slot]].tree_child = node << 3 | slot;
    }
  }
  uint64_t node_count = tables.nodes.size();
  for (const BuiltObject& object : objects) node_count += object.nodes.size();
  if (node_count > kMaxTopNodes) {
    return Error{ErrorCode::kInput,
                 fmt::format("nodes of the top tree: expected at most {}, found {}", kMaxTopNodes, node_count)};
  }
  std::vector<uint32_t> root(objects.size(), kNoIndex);
  for (size_t i = 0; i < objects.size(); ++i) {
    root[i] = static_cast<uint32_t>(tables.nodes.size());
    append_object(objects[i], tables);
  }
  for (Instance& instance : tables.instances) instance.root_node = root[instance.object];
  return tables;
}

}  // namespace shoal
