#include "engine/motion_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "treelets/moving_instance.h"

namespace shoal {

namespace {

/// Keys are halved until the middle of two is off by less than this part of the size and of the way.
constexpr double kTolerance = 1e-3;
/// So many that what swings to and fro is seen to move.
constexpr uint32_t kFewestKeys = 17;
/// A matrix here and in its map, its row and its copies.
constexpr uint64_t kRowBytes = 1024;
/// More keys than the fewest are taken while all nodes together have so many.
constexpr uint64_t kMaxMotionRows = 1u << 17;

using Worlds = std::map<uint32_t, AffineDouble>;

/// Nodes at and below those that the animation moves.
std::set<uint32_t> moved_nodes(const gltf::Document& document, uint32_t animation) {
  std::vector<uint32_t> stack;
  for (const gltf::AnimationChannel& channel : document.animations[animation].channels) {
    if (channel.path != gltf::AnimatedPath::kWeights) stack.push_back(channel.node);
  }
  std::set<uint32_t> moved;
  while (!stack.empty()) {
    const uint32_t node = stack.back();
    stack.pop_back();
    if (!moved.insert(node).second) continue;
    stack.insert(stack.end(), document.nodes[node].children.begin(), document.nodes[node].children.end());
  }
  return moved;
}

/// Of these nodes, where the scene shows them.
Worlds worlds_of(const gltf::Document& document, const std::set<uint32_t>& nodes) {
  Worlds worlds;
  std::vector<std::pair<uint32_t, AffineDouble>> stack;
  for (const uint32_t root : document.roots) stack.emplace_back(root, AffineDouble{});
  while (!stack.empty()) {
    const auto [node, parent] = stack.back();
    stack.pop_back();
    const AffineDouble world = multiply(parent, affine_of(document.nodes[node].matrix));
    if (nodes.contains(node)) worlds[node] = world;
    for (const uint32_t child : document.nodes[node].children) stack.emplace_back(child, world);
  }
  return worlds;
}

double size_of(const AffineDouble& m) {
  double largest = 0;
  for (const Vec3d& column : m.column) {
    for (const double v : column) largest = std::max(largest, std::fabs(v));
  }
  return largest;
}

double distance(const Vec3d& a, const Vec3d& b) {
  return std::max({std::fabs(a[0] - b[0]), std::fabs(a[1] - b[1]), std::fabs(a[2] - b[2])});
}

/// Whether the middle of `a` and `b` is close enough to `m`. `way`: how far the node goes while the shutter is open.
bool straight(const AffineDouble& a, const AffineDouble& m, const AffineDouble& b, double way) {
  double off = 0;
  Vec3d middle;
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) middle[i] = 0.5 * (a.column[c][i] + b.column[c][i]);
    off = std::max(off, distance(middle, m.column[c]));
  }
  for (int i = 0; i < 3; ++i) middle[i] = 0.5 * (a.translation[i] + b.translation[i]);
  return off <= kTolerance * size_of(m) && distance(middle, m.translation) <= kTolerance * way;
}

class MotionFinder {
 public:
  MotionFinder(gltf::BufferFiles& files, gltf::Document& document, const ChosenPose& pose, uint64_t most_rows)
      : files_(files), document_(document), pose_(pose), most_rows_(most_rows) {}

  Result<MotionKeys> find() {
    choose_nodes();
    SHOAL_RETURN_IF_ERROR(refine(kFewestKeys));
    for (uint32_t keys = kFewestKeys; !all_straight(); keys = 2 * keys - 1) {
      if (2 * keys - 1 > kMaxMotionKeys || nodes_.size() * (2 * keys - 1) > kMaxMotionRows) break;
      SHOAL_RETURN_IF_ERROR(refine(2 * keys - 1));
    }
    collect();
    return std::move(motion_);
  }

 private:
  /// A cap too small is refused: fewer keys would change the picture.
  Status check_rows(uint64_t keys) const {
    if (nodes_.size() * keys <= most_rows_) return {};
    return Error{ErrorCode::kMemoryCap,
                 fmt::format("{}: {} nodes move while the shutter is open: building needs a memory cap of {} MiB at least",
                             document_.path, nodes_.size(), (8 * kRowBytes * keys * nodes_.size() >> 20) + 1)};
  }

  void choose_nodes() {
    const std::set<uint32_t> moved = moved_nodes(document_, pose_.animation);
    for (const auto& [node, world] : worlds_of(document_, moved)) {
      const gltf::Node& n = document_.nodes[node];
      const bool instanced = document_.instancings.contains(node);
      if (n.light) warn(fmt::format("nodes[{}]: its light", node));
      if (n.mesh && instanced) warn(fmt::format("nodes[{}]: its instances", node));
      if (shows_rigid_mesh(node) || n.camera) nodes_.insert(node);
    }
    warn_of_deforming(moved);
  }

  bool shows_rigid_mesh(uint32_t node) const {
    return document_.nodes[node].mesh && !document_.nodes[node].skin && !document_.instancings.contains(node);
  }

  void warn_of_deforming(const std::set<uint32_t>& moved) {
    std::set<uint32_t> morphed;
    for (const gltf::AnimationChannel& channel : document_.animations[pose_.animation].channels) {
      if (channel.path == gltf::AnimatedPath::kWeights) morphed.insert(channel.node);
    }
    std::vector<uint32_t> stack(document_.roots.rbegin(), document_.roots.rend());
    while (!stack.empty()) {
      const uint32_t node = stack.back();
      stack.pop_back();
      const gltf::Node& n = document_.nodes[node];
      stack.insert(stack.end(), n.children.rbegin(), n.children.rend());
      if (!n.mesh) continue;
      if (morphed.contains(node)) warn(fmt::format("nodes[{}]: its morph targets", node));
      if (!n.skin) continue;
      const std::vector<uint32_t>& joints = document_.skins[*n.skin].joints;
      const bool bends = std::any_of(joints.begin(), joints.end(), [&](uint32_t j) { return moved.contains(j); });
      if (bends) warn(fmt::format("nodes[{}]: its skin", node));
    }
  }

  void warn(const std::string& what) {
    const char* are = what.ends_with('s') ? " are not blurred: they stand" : " is not blurred: it stands";
    motion_.warnings.push_back(what + are + " as in the middle of the shutter");
  }

  /// Samples so many keys, of which every other is known.
  Status refine(uint32_t keys) {
    SHOAL_RETURN_IF_ERROR(check_rows(keys));
    std::vector<Worlds> all(keys);
    for (uint32_t k = 0; k < keys; ++k) {
      if (k % 2 == 0 && keys > kFewestKeys) {
        all[k] = std::move(worlds_[k / 2]);
        continue;
      }
      const double time = pose_.open + static_cast<double>(k) / (keys - 1) * (pose_.close - pose_.open);
      SHOAL_RETURN_IF_ERROR(animate(files_, document_, pose_.animation, time));
      all[k] = worlds_of(document_, nodes_);
    }
    worlds_ = std::move(all);
    return {};
  }

  double way_of(uint32_t node) const {
    double way = 0;
    for (const Worlds& worlds : worlds_) {
      way = std::max(way, distance(worlds.at(node).translation, worlds_[0].at(node).translation));
    }
    return way;
  }

  bool all_straight() const {
    for (const auto& [node, world] : worlds_[0]) {
      const double way = way_of(node);
      for (size_t k = 1; k + 1 < worlds_.size(); k += 2) {
        const bool good = straight(worlds_[k - 1].at(node), worlds_[k].at(node), worlds_[k + 1].at(node), way);
        if (!good) return false;
      }
    }
    return true;
  }

  void collect() {
    for (const auto& [node, first] : worlds_[0]) {
      std::vector<AffineDouble> keys;
      bool moves = false;
      for (const Worlds& worlds : worlds_) {
        const AffineDouble& world = worlds.at(node);
        moves = moves || distance(world.translation, first.translation) > 0;
        for (int c = 0; c < 3; ++c) moves = moves || distance(world.column[c], first.column[c]) > 0;
        keys.push_back(world);
      }
      if (!moves) continue;
      if (shows_rigid_mesh(node)) motion_.meshes.emplace(node, keys);
      if (document_.nodes[node].camera) motion_.cameras.emplace(node, std::move(keys));
    }
    const bool any = !motion_.meshes.empty() || !motion_.cameras.empty();
    motion_.key_count = any ? static_cast<uint32_t>(worlds_.size()) : 0;
  }

  gltf::BufferFiles& files_;
  gltf::Document& document_;
  const ChosenPose& pose_;
  const uint64_t most_rows_;
  std::set<uint32_t> nodes_;    // that show a rigid mesh or have a camera, and may move
  std::vector<Worlds> worlds_;  // by key
  MotionKeys motion_;
};

}  // namespace

Result<MotionKeys> find_motion(gltf::BufferFiles& files, gltf::Document& document, const ChosenPose& pose,
                               uint64_t most_rows) {
  return MotionFinder(files, document, pose, most_rows).find();
}

std::vector<Affine3> add_camera_keys(const MotionKeys& motion, const FlatScene& scene,
                                     std::vector<CameraRecord>& cameras) {
  std::vector<Affine3> rows;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const auto found = motion.cameras.find(scene.cameras[i].node);
    if (found == motion.cameras.end()) continue;
    std::vector<Affine3> keys;
    for (const AffineDouble& key : found->second) keys.push_back(rounded(key));
    if (!std::all_of(keys.begin(), keys.end(), [](const Affine3& key) { return finite(widened(key)); })) continue;
    cameras[i].first_key = static_cast<uint32_t>(rows.size());
    cameras[i].key_count = static_cast<uint32_t>(keys.size());
    rows.insert(rows.end(), keys.begin(), keys.end());
  }
  return rows;
}

uint64_t most_motion_rows(uint64_t cap_bytes) { return cap_bytes / 8 / kRowBytes; }

}  // namespace shoal
