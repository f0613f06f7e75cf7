// Nodes, the default scene and the check that the nodes are a forest of bounded depth.
#include <fmt/format.h>

#include <cmath>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

std::array<double, 16> read_matrix(const JsonNode& node) {
  if (node.member("matrix").present()) {
    const auto matrix = node.numbers<16>("matrix", {});
    if (matrix[3] != 0 || matrix[7] != 0 || matrix[11] != 0 || matrix[15] != 1) {
      node.fail_at("matrix", "an affine matrix with a last row of 0 0 0 1",
                   fmt::format("{} {} {} {}", matrix[3], matrix[7], matrix[11], matrix[15]));
    }
    return matrix;
  }
  const auto rotation = node.numbers<4>("rotation", {0, 0, 0, 1});
  if (rotation == std::array<double, 4>{}) node.fail_at("rotation", "a unit quaternion", "0 0 0 0");
  return compose_matrix(node.numbers<3>("translation", {0, 0, 0}), rotation, node.numbers<3>("scale", {1, 1, 1}));
}

std::vector<uint32_t> read_node_list(const JsonNode& parent, const char* name, const Limits& limits,
                                     const Document& document) {
  std::vector<uint32_t> list;
  const JsonNode array = parent.array(name, limits.objects_count);
  list.reserve(array.size());
  for (uint64_t i = 0; i < array.size() && !parent.failed(); ++i) {
    list.push_back(static_cast<uint32_t>(array[i].as_index(document.nodes.size())));
  }
  return list;
}

void read_node(const JsonNode& node, uint64_t skins_count, const Limits& limits, Document& document, Node& out) {
  out.name = node.text("name");
  out.children = read_node_list(node, "children", limits, document);
  out.matrix = read_matrix(node);
  out.mesh = node.index("mesh", document.meshes.size());
  out.camera = node.index("camera", document.cameras.size());
  out.skin = node.index("skin", skins_count);
  out.light = node.object("extensions").object("KHR_lights_punctual").index("light", document.lights.size());
}

std::optional<uint32_t> read_instance_accessor(const JsonNode& attributes, const char* name, uint32_t components,
                                               const Document& document, std::optional<uint64_t>& count) {
  const auto index = attributes.index(name, document.accessors.size());
  if (!index || attributes.failed()) return index;
  const Accessor& accessor = document.accessors[*index];
  if (accessor.components != components || accessor.matrix) {
    attributes.fail_at(name, fmt::format("an accessor of {} components", components),
                       fmt::format("accessors[{}] of {}", *index, accessor.components));
  } else if (count && *count != accessor.count) {
    attributes.fail_at(name, fmt::format("{} elements, as the other attributes have", *count),
                       fmt::format("{}", accessor.count));
  }
  count = accessor.count;
  return index;
}

void read_node_weights(const JsonNode& node, uint32_t index, Document& document) {
  if (!document.nodes[index].mesh || !node.member("weights").present()) return;
  std::vector<double> weights = read_weights(node);
  if (!weights.empty()) document.node_weights.emplace(index, std::move(weights));
}

void read_instancing(const JsonNode& node, uint32_t index, Document& document) {
  const JsonNode attributes = node.object("extensions").object("EXT_mesh_gpu_instancing").object("attributes");
  if (!attributes.present() || !document.nodes[index].mesh) return;
  Instancing out;
  std::optional<uint64_t> count;
  out.translation = read_instance_accessor(attributes, "TRANSLATION", 3, document, count);
  out.rotation = read_instance_accessor(attributes, "ROTATION", 4, document, count);
  out.scale = read_instance_accessor(attributes, "SCALE", 3, document, count);
  if (node.failed() || !count) return;  // attributes of applications alone place nothing
  out.count = *count;
  document.instancings.emplace(index, out);
}

constexpr uint32_t kNoParent = 0xffffffffu;

std::vector<uint32_t> find_parents(const JsonNode& nodes, const Document& document) {
  std::vector<uint32_t> parents(document.nodes.size(), kNoParent);
  for (uint32_t i = 0; i < document.nodes.size(); ++i) {
    for (const uint32_t child : document.nodes[i].children) {
      if (parents[child] != kNoParent) {
        nodes[i].fail_at("children", fmt::format("one parent of nodes[{}]", child),
                         fmt::format("two, of which one is nodes[{}]", parents[child]));
        return parents;
      }
      parents[child] = i;
    }
  }
  return parents;
}

/// Walks from the parentless nodes, level by level. As every node has at most one parent, what is not reached
/// hangs in a cycle.
void check_forest(const JsonNode& nodes, const std::vector<uint32_t>& parents, const Limits& limits,
                  const Document& document) {
  std::vector<uint32_t> level, next;
  for (uint32_t i = 0; i < parents.size(); ++i) {
    if (parents[i] == kNoParent) level.push_back(i);
  }
  uint64_t reached_count = 0, mesh_count = 0;
  for (uint32_t depth = 1; !level.empty(); ++depth) {
    if (depth > limits.node_depth) {
      return nodes[level.front()].fail(fmt::format("nodes at most {} deep", limits.node_depth), "a deeper one");
    }
    next.clear();
    for (const uint32_t i : level) {
      mesh_count += document.nodes[i].mesh.has_value();
      next.insert(next.end(), document.nodes[i].children.begin(), document.nodes[i].children.end());
    }
    reached_count += level.size();
    level.swap(next);
  }
  if (reached_count < parents.size()) nodes.fail("nodes without a cycle", "one");
  if (mesh_count > limits.instances_count) {
    nodes.fail(fmt::format("at most {} nodes with meshes", limits.instances_count), fmt::format("{}", mesh_count));
  }
}

void read_roots(const JsonNode& root, const std::vector<uint32_t>& parents, const Limits& limits,
                Document& document) {
  const JsonNode scenes = root.array("scenes", limits.objects_count);
  const auto chosen = root.index("scene", scenes.size());
  if (root.failed()) return;
  if (scenes.size() == 0) {
    for (uint32_t i = 0; i < parents.size(); ++i) {
      if (parents[i] == kNoParent) document.roots.push_back(i);
    }
    return;
  }
  const JsonNode scene = scenes.object_at(chosen.value_or(0));
  document.roots = read_node_list(scene, "nodes", limits, document);
  std::vector<bool> listed(document.nodes.size());
  for (const uint32_t i : document.roots) {
    if (root.failed()) return;
    if (parents[i] != kNoParent) scene.fail_at("nodes", "nodes without a parent", fmt::format("nodes[{}]", i));
    if (listed[i]) scene.fail_at("nodes", "each node once", fmt::format("nodes[{}] twice", i));
    listed[i] = true;
  }
}

}  // namespace

std::array<double, 16> compose_matrix(const std::array<double, 3>& t, const std::array<double, 4>& q,
                                      const std::array<double, 3>& s) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
  return {s[0] * (1 - 2 * (y * y + z * z)),
          s[0] * 2 * (x * y + w * z),
          s[0] * 2 * (x * z - w * y),
          0,
          s[1] * 2 * (x * y - w * z),
          s[1] * (1 - 2 * (x * x + z * z)),
          s[1] * 2 * (y * z + w * x),
          0,
          s[2] * 2 * (x * z + w * y),
          s[2] * 2 * (y * z - w * x),
          s[2] * (1 - 2 * (x * x + y * y)),
          0,
          t[0],
          t[1],
          t[2],
          1};
}

void read_nodes(const JsonNode& root, const Limits& limits, Document& document) {
  const uint64_t skins_count = root.array("skins", limits.objects_count).size();
  const JsonNode array = root.array("nodes", limits.objects_count);
  document.nodes.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    const JsonNode node = array.object_at(i);
    read_node(node, skins_count, limits, document, document.nodes[i]);
    read_node_weights(node, static_cast<uint32_t>(i), document);
    read_instancing(node, static_cast<uint32_t>(i), document);
  }
  if (root.failed()) return;
  const auto parents = find_parents(array, document);
  if (root.failed()) return;
  check_forest(array, parents, limits, document);
  read_roots(root, parents, limits, document);
}

}  // namespace shoal::gltf
