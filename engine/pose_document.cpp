#include "engine/pose_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/affine_double.h"
#include "engine/animation_sample.h"
#include "engine/flatten_nodes.h"
#include "engine/scene.h"
#include "io/gltf_json.h"

namespace shoal {

namespace {

using gltf::AnimatedPath;

/// The index that a text of digits is.
std::optional<uint32_t> index_of(const std::string& text) {
  uint32_t index = 0;
  const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (code != std::errc() || rest != text.data() + text.size()) return std::nullopt;
  return index;
}

class Poser {
 public:
  Poser(gltf::BufferFiles& files, gltf::Document& document, std::vector<std::string>& warnings)
      : files_(files), document_(document), warnings_(warnings) {}

  /// Gives every mesh that is shown its weights and joints.
  Status pose_meshes() {
    if (!document_.skins.empty()) find_joints();
    std::vector<uint32_t> stack(document_.roots.rbegin(), document_.roots.rend());  // in scene order
    while (!stack.empty()) {
      const uint32_t node = stack.back();
      stack.pop_back();
      stack.insert(stack.end(), document_.nodes[node].children.rbegin(), document_.nodes[node].children.rend());
      if (document_.nodes[node].mesh) SHOAL_RETURN_IF_ERROR(pose_mesh(node));
    }
    return {};
  }

 private:
  /// World matrices of all joints, by one walk over all nodes.
  void find_joints() {
    for (const gltf::Skin& skin : document_.skins) {
      for (const uint32_t joint : skin.joints) worlds_.try_emplace(joint);
    }
    std::vector<bool> has_parent(document_.nodes.size());
    for (const gltf::Node& node : document_.nodes) {
      for (const uint32_t child : node.children) has_parent[child] = true;
    }
    std::vector<std::pair<uint32_t, AffineDouble>> stack;
    for (uint32_t i = 0; i < document_.nodes.size(); ++i) {
      if (!has_parent[i]) stack.emplace_back(i, AffineDouble{});
    }
    while (!stack.empty()) {
      const auto [node, parent] = stack.back();
      stack.pop_back();
      const AffineDouble world = multiply(parent, affine_of(document_.nodes[node].matrix));
      if (const auto joint = worlds_.find(node); joint != worlds_.end()) joint->second = world;
      for (const uint32_t child : document_.nodes[node].children) stack.emplace_back(child, world);
    }
  }

  /// Made when the first node that is shown asks for it: others may be compressed still.
  Result<std::shared_ptr<const gltf::JointMatrices>> posed_skin(uint32_t s) {
    const auto known = skins_.find(s);
    if (known != skins_.end()) return known->second;
    SHOAL_ASSIGN_OR_RETURN(auto matrices, joint_matrices(s));
    skins_.emplace(s, matrices);
    return matrices;
  }

  Result<std::shared_ptr<const gltf::JointMatrices>> joint_matrices(uint32_t s) {
    const gltf::Skin& skin = document_.skins[s];
    auto matrices = std::make_shared<gltf::JointMatrices>();
    matrices->reserve(skin.joints.size());
    std::optional<gltf::AccessorReader> reader;
    if (skin.inverse_bind) {
      SHOAL_ASSIGN_OR_RETURN(reader, gltf::AccessorReader::open(files_, document_, *skin.inverse_bind));
    }
    for (size_t j = 0; j < skin.joints.size(); ++j) {
      AffineDouble map = worlds_.at(skin.joints[j]);
      if (reader) {
        std::array<float, 16> bind;
        SHOAL_RETURN_IF_ERROR(reader->read_floats(j, 1, bind));
        std::array<double, 16> wide;
        std::copy(bind.begin(), bind.end(), wide.begin());
        map = multiply(map, affine_of(wide));
      }
      if (!finite(map)) {
        return Error{ErrorCode::kInput,
                     fmt::format("{}: skins[{}]: joint {} (nodes[{}]): expected a finite matrix, found one that is not",
                                 document_.path, s, j, skin.joints[j])};
      }
      std::array<double, 12> out;
      for (size_t c = 0; c < 3; ++c) std::copy(map.column[c].begin(), map.column[c].end(), &out[3 * c]);
      std::copy(map.translation.begin(), map.translation.end(), &out[9]);
      matrices->push_back(out);
    }
    return std::shared_ptr<const gltf::JointMatrices>(std::move(matrices));
  }

  /// The mesh's own weights count where the node has none; those of other lengths are an error.
  Result<std::vector<double>> weights_of(uint32_t node) const {
    const uint32_t m = *document_.nodes[node].mesh;
    const gltf::Mesh& mesh = document_.meshes[m];
    const size_t targets = mesh.primitives.empty() ? 0 : mesh.primitives.front().targets.size();
    const auto own = document_.node_weights.find(node);
    if (own == document_.node_weights.end()) return rest_weights_.contains(m) ? rest_weights_.at(m) : mesh.weights;
    if (own->second.size() != targets) {
      return Error{ErrorCode::kInput,
                   fmt::format("{}: nodes[{}]: expected {} weights, one a morph target of meshes[{}], found {}",
                               document_.path, node, targets, m, own->second.size())};
    }
    return own->second;
  }

  Status pose_mesh(uint32_t index) {
    gltf::Node& node = document_.nodes[index];
    const uint32_t m = *node.mesh;
    SHOAL_ASSIGN_OR_RETURN(std::vector<double> weights, weights_of(index));
    std::shared_ptr<const gltf::JointMatrices> joints;
    if (node.skin && document_.instancings.contains(index)) {
      warnings_.push_back(fmt::format("nodes[{}] is instanced: its skin is left out", index));
    } else if (node.skin) {
      SHOAL_ASSIGN_OR_RETURN(joints, posed_skin(*node.skin));
    }
    const bool first = users_.insert(m).second;
    const uint32_t posed = first ? m : static_cast<uint32_t>(document_.meshes.size());
    // What goes by its joints lies in world space, so it is not shared even where it is the same.
    if (!joints) {
      const auto [known, added] = unskinned_.try_emplace({m, without_last_zeros(weights)}, posed);
      node.mesh = known->second;
      if (!added) return {};
    }
    if (first) {
      rest_weights_.emplace(m, document_.meshes[m].weights);
    } else {
      gltf::Mesh copy = document_.meshes[m];
      document_.meshes.push_back(std::move(copy));
    }
    node.mesh = posed;
    document_.meshes[posed].weights = std::move(weights);
    document_.meshes[posed].joints = std::move(joints);
    return {};
  }

  /// A target that has no weight is one of weight 0.
  static std::vector<double> without_last_zeros(std::vector<double> weights) {
    while (!weights.empty() && weights.back() == 0) weights.pop_back();
    return weights;
  }

  gltf::BufferFiles& files_;
  gltf::Document& document_;
  std::vector<std::string>& warnings_;
  std::map<uint32_t, AffineDouble> worlds_;  // of joints
  std::map<uint32_t, std::shared_ptr<const gltf::JointMatrices>> skins_;
  std::map<std::pair<uint32_t, std::vector<double>>, uint32_t> unskinned_;  // the mesh in each pose, by its weights
  std::set<uint32_t> users_;                              // meshes that a node shows
  std::map<uint32_t, std::vector<double>> rest_weights_;  // of those, as the document has them
};

bool has_targets(const gltf::Document& document) {
  for (const gltf::Mesh& mesh : document.meshes) {
    if (!mesh.primitives.empty() && !mesh.primitives.front().targets.empty()) return true;
  }
  return false;
}

/// Of one more pose of a mesh; an attribute is a name and a node of a map.
uint64_t copy_bytes(const gltf::Mesh& mesh) {
  constexpr uint64_t kAttributeBytes = 96;
  uint64_t bytes = sizeof(gltf::Mesh) + mesh.name.size();
  for (const gltf::Primitive& primitive : mesh.primitives) {
    bytes += sizeof(gltf::Primitive) + primitive.attributes.size() * kAttributeBytes +
             primitive.targets.size() * (sizeof(gltf::MorphTarget) + sizeof(double));
  }
  return bytes;
}

}  // namespace

Result<std::optional<ChosenPose>> choose_pose(const gltf::Document& document, const PoseOptions& options) {
  if (!options.wanted()) return std::optional<ChosenPose>();
  const auto wrong = [&](const std::string& message) {
    return Error{ErrorCode::kUsage, fmt::format("{}: {}", document.path, message)};
  };
  if (options.time && !std::isfinite(*options.time)) return wrong("a time must be a finite number of seconds");
  const std::vector<gltf::Animation>& animations = document.animations;
  if (animations.empty()) return wrong("a time or an animation was asked for, the scene has no animation");
  ChosenPose pose;
  pose.time = options.time.value_or(0);
  pose.open = pose.close = pose.time;
  pose.shutter = options.shutter;
  if (options.shutter) {
    pose.open += (*options.shutter)[0], pose.close += (*options.shutter)[1];
    const bool lasts = std::isfinite(pose.open) && std::isfinite(pose.close) && pose.close > pose.open;
    if (!lasts) return wrong("a shutter must open before it closes, both at finite times");
  }
  if (!options.animation.empty()) {
    const auto named = std::find_if(animations.begin(), animations.end(),
                                    [&](const gltf::Animation& a) { return a.name == options.animation; });
    pose.animation = named != animations.end() ? static_cast<uint32_t>(named - animations.begin())
                                               : index_of(options.animation).value_or(0xffffffffu);
    if (pose.animation >= animations.size()) {
      return wrong(fmt::format("the animation '{}' was asked for, the scene has {}", options.animation,
                               animations.size()));
    }
  }
  pose.name = animations[pose.animation].name;
  if (!animations[pose.animation].broken.empty()) return Error{ErrorCode::kInput, animations[pose.animation].broken};
  return std::optional<ChosenPose>(std::move(pose));
}

uint64_t pose_bytes(const gltf::Document& document) {
  // The matrices, and the world matrices that they are made of.
  constexpr uint64_t kJointBytes = 12 * sizeof(double) + sizeof(AffineDouble) + 64;
  uint64_t bytes = 0;
  for (const gltf::Skin& skin : document.skins) bytes += skin.joints.size() * kJointBytes;
  if (document.skins.empty() && !has_targets(document)) return bytes;
  std::set<uint32_t> shown;
  std::vector<uint32_t> stack = document.roots;
  while (!stack.empty()) {
    const gltf::Node& node = document.nodes[stack.back()];
    stack.pop_back();
    stack.insert(stack.end(), node.children.begin(), node.children.end());
    if (node.mesh && !shown.insert(*node.mesh).second) bytes += copy_bytes(document.meshes[*node.mesh]);
  }
  return bytes;
}

Status animate(gltf::BufferFiles& files, gltf::Document& document, uint32_t animation, double time) {
  AnimationSampler sampler(files, document, animation, time);
  std::map<uint32_t, gltf::RestPlace> places;
  for (const gltf::AnimationChannel& channel : document.animations[animation].channels) {
    const bool weights = channel.path == AnimatedPath::kWeights;
    if (weights && !document.nodes[channel.node].mesh) continue;  // weights of nothing
    SHOAL_ASSIGN_OR_RETURN(const std::vector<double> v, sampler.sample(channel));
    if (weights) {
      document.node_weights[channel.node] = v;
      continue;
    }
    gltf::RestPlace& place = places.try_emplace(channel.node, document.rest_places.at(channel.node)).first->second;
    if (channel.path == AnimatedPath::kTranslation) place.translation = {v[0], v[1], v[2]};
    if (channel.path == AnimatedPath::kRotation) place.rotation = {v[0], v[1], v[2], v[3]};
    if (channel.path == AnimatedPath::kScale) place.scale = {v[0], v[1], v[2]};
  }
  for (const auto& [node, place] : places) {
    document.nodes[node].matrix = gltf::compose_matrix(place.translation, place.rotation, place.scale);
  }
  return {};
}

Status pose_document(gltf::BufferFiles& files, gltf::Document& document, const std::optional<ChosenPose>& pose,
                     std::vector<std::string>& warnings) {
  if (pose) SHOAL_RETURN_IF_ERROR(animate(files, document, pose->animation, pose->middle()));
  if (document.skins.empty() && !has_targets(document)) return {};
  return Poser(files, document, warnings).pose_meshes();
}

Result<std::array<double, 2>> parse_shutter(const std::string& text) {
  std::array<double, 2> out{};
  const char* const end = text.data() + text.size();
  const auto [middle, code] = std::from_chars(text.data(), end, out[0]);
  if (code == std::errc() && middle != end && *middle == ':') {
    const auto [rest, code2] = std::from_chars(middle + 1, end, out[1]);
    if (code2 == std::errc() && rest == end && out[0] < out[1]) return out;
  }
  return Error{ErrorCode::kUsage,
               fmt::format("'{}' is no shutter: expected OPEN:CLOSE in seconds after --time, such as 0:0.02", text)};
}

Status check_pose(const Scene& scene, const PoseOptions& options) {
  if (!options.wanted()) return {};
  const auto record = nlohmann::json::parse(scene.build_record, nullptr, false);
  const nlohmann::json built = record.is_object() ? record.value("options", nlohmann::json()) : nlohmann::json();
  const bool posed = built.is_object() && built.contains("animation") && built["animation"].is_number_unsigned() &&
                     built.contains("time") && built["time"].is_number();
  std::string found = "with its nodes at rest";
  if (posed) {
    const auto index = built["animation"].get<uint64_t>();
    const bool named = built.contains("animation_name") && built["animation_name"].is_string();
    const std::string name = named ? built["animation_name"].get<std::string>() : std::string();
    const bool animation = options.animation.empty() ? index == 0
                                                     : options.animation == name || index_of(options.animation) == index;
    const nlohmann::json shutter = options.shutter ? nlohmann::json(*options.shutter) : nlohmann::json();
    const nlohmann::json built_shutter = built.value("shutter", nlohmann::json());
    const bool same_time = built["time"].get<double>() == options.time.value_or(0) && built_shutter == shutter;
    if (animation && same_time) return {};
    found = fmt::format("at {} s of animation {}{}{}", built["time"].get<double>(), index,
                        name.empty() ? "" : " (" + gltf::printable(name) + ")",
                        built_shutter.is_null() ? "" : ", with a shutter of " + built_shutter.dump());
  }
  return Error{ErrorCode::kUsage,
               fmt::format("{} was built {}: build it again with the --time, --animation and --shutter that are asked "
                           "for, or render the glTF itself", scene.file->path(), found)};
}

}  // namespace shoal
