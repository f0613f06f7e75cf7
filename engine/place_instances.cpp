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

/// Puts the keys behind the instances.
void append_keys(std::span<const PlacedInstance> placed, std::vector<Instance>& rows) {
  for (size_t i = 0; i < placed.size(); ++i) {
    if (placed[i].keys.empty()) continue;
    rows[i].motion_rows = static_cast<uint32_t>(rows.size() - i);
    rows[i].key_count = static_cast<uint32_t>(placed[i].keys.size());
    rows.insert(rows.end(), placed[i].keys.begin(), placed[i].keys.end());
  }
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

namespace {

double row_sum(const AffineDouble& m) {
  const AffineDouble one;
  return absolute_row_sum(m, one);
}

/// How far, in each coordinate, |M x + t| may be for any x in the object.
double reach_of(const Instance& row) {
  const AffineDouble m = widened(row.object_to_world);
  double shift = 0;
  for (const double t : m.translation) shift = std::max(shift, std::abs(t));
  return shift + row_sum(m) * row.max_abs_coordinate;
}

/// Half the way from key `a` to `b`, seen from `a`: e = |A^-1 (B - A)| / 2. Every map of the nearer half of the way is
/// A (I + s A^-1 (B - A)) with s <= 1/2, hence has an inverse of norm |A^-1| / (1 - e) at most where e < 1.
double half_way(const Instance& a, const Instance& b) {
  const AffineDouble from = widened(a.object_to_world), to = widened(b.object_to_world), back = inverse(from);
  AffineDouble step;
  for (int c = 0; c < 3; ++c) {
    Vec3d change;
    for (int i = 0; i < 3; ++i) change[i] = to.column[c][i] - from.column[c][i];
    step.column[c] = back.vector(change);
  }
  return 0.5 * row_sum(step);
}

/// Keys further apart than this are no ends of a straight way: a turn of 45 degrees.
constexpr double kFarthestHalfWay = 0.51;

/// Instance::transform_error of all times; says at which keys the instance stays.
double bound_transform_error(std::vector<Instance>& keys) {
  double largest = 0, largest_back = 0, error = 0, farthest = 0;
  for (size_t k = 0; k < keys.size(); ++k) {
    error = std::max(error, static_cast<double>(keys[k].transform_error));
    if (k + 1 == keys.size()) break;
    const double far = std::max(half_way(keys[k], keys[k + 1]), half_way(keys[k + 1], keys[k]));
    if (!(far <= kFarthestHalfWay)) {
      keys[k].key_count = 1;
      continue;
    }
    farthest = std::max(farthest, far);
    for (size_t end = k; end < k + 2; ++end) {
      const AffineDouble map = widened(keys[end].object_to_world);
      largest = std::max(largest, row_sum(map)), largest_back = std::max(largest_back, row_sum(inverse(map)));
    }
  }
  return std::max(error, largest * largest_back / (1 - farthest));
}

}  // namespace

std::optional<PlacedInstance> place_moving_instance(uint32_t object, const Bounds3& object_bounds,
                                                    std::span<const AffineDouble> keys) {
  std::optional<PlacedInstance> placed;
  double reach = 0;
  for (const AffineDouble& key : keys) {
    const auto there = place_instance(object, object_bounds, key);
    if (!there) return std::nullopt;
    if (!placed) placed = there;
    if (placed->keys.size() == keys.size() / 2) placed->instance = there->instance;  // it rests as in the middle
    Instance row = there->instance;
    row.tree_child = kNoIndex;
    row.identity = 0;
    if (there->instance.identity) row.world_to_object = {};
    reach = std::max(reach, reach_of(row));
    placed->keys.push_back(row);
    placed->bounds.include(there->bounds);
  }
  const auto transform_error = static_cast<float>(bound_transform_error(placed->keys));
  placed->instance.identity = 0;
  placed->instance.transform_error = transform_error;
  for (Instance& row : placed->keys) row.transform_error = transform_error;
  // As the pad of world_bounds() for the largest error at any time; the elements between two keys are rounded three
  // times more, which the factor of two that it leaves holds.
  const Vec3 pad(static_cast<float>(reach * transform_error * 0x1p-21));
  placed->bounds.lo -= pad, placed->bounds.hi += pad;
  if (!std::isfinite(transform_error) || !finite(placed->bounds)) return std::nullopt;
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
  append_keys(placed, tables.instances);
  return tables;
}

}  // namespace shoal
