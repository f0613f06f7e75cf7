// Skins and animations: shapes are checked here, values where they are read.
#include <fmt/format.h>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

/// Of a skin: far above any rig, and what an index of 16 bits can name.
constexpr uint64_t kMaxJoints = 65536;

bool is_floats(const Accessor& accessor, uint32_t components) {
  return accessor.components == components && accessor.type == ComponentType::kFloat;
}

void read_skin(const JsonNode& node, const Limits& limits, const Document& document, Skin& skin) {
  const JsonNode joints = node.array("joints", std::min(limits.objects_count, kMaxJoints));
  if (joints.size() == 0) node.fail_at("joints", "one node at least", "none");
  for (uint64_t i = 0; i < joints.size() && !node.failed(); ++i) {
    skin.joints.push_back(static_cast<uint32_t>(joints[i].as_index(document.nodes.size())));
  }
  skin.inverse_bind = node.index("inverseBindMatrices", document.accessors.size());
  if (!skin.inverse_bind || node.failed()) return;
  const Accessor& accessor = document.accessors[*skin.inverse_bind];
  if (!is_floats(accessor, 16) || !accessor.matrix || accessor.count < skin.joints.size()) {
    node.fail_at("inverseBindMatrices", fmt::format("{} matrices of 4 x 4 floats", skin.joints.size()),
                 fmt::format("accessors[{}] of {} elements of {} components", *skin.inverse_bind, accessor.count,
                             accessor.components));
  }
}

Interpolation read_interpolation(const JsonNode& sampler) {
  const std::string name = sampler.text("interpolation", "LINEAR");
  if (name == "STEP") return Interpolation::kStep;
  if (name == "CUBICSPLINE") return Interpolation::kCubicSpline;
  if (name != "LINEAR") sampler.fail_at("interpolation", "STEP, LINEAR or CUBICSPLINE", printable(name));
  return Interpolation::kLinear;
}

/// Components of a value; a weight is one.
uint32_t width_of(AnimatedPath path) {
  if (path == AnimatedPath::kRotation) return 4;
  return path == AnimatedPath::kWeights ? 1 : 3;
}

void read_sampler(const JsonNode& sampler, const Document& document, AnimationChannel& channel) {
  channel.input = sampler.required_index("input", document.accessors.size());
  channel.output = sampler.required_index("output", document.accessors.size());
  channel.interpolation = read_interpolation(sampler);
  if (sampler.failed()) return;
  const Accessor &input = document.accessors[channel.input], &output = document.accessors[channel.output];
  if (!is_floats(input, 1) || input.count == 0) {
    sampler.fail_at("input", "times as float scalars", fmt::format("accessors[{}]", channel.input));
  }
  if (output.components != width_of(channel.path) || output.matrix) {
    sampler.fail_at("output", fmt::format("values of {} components", width_of(channel.path)),
                    fmt::format("accessors[{}] of {}", channel.output, output.components));
  }
  const uint64_t values = input.count * (channel.interpolation == Interpolation::kCubicSpline ? 3 : 1);
  const bool weights = channel.path == AnimatedPath::kWeights;
  const bool whole = weights ? output.count % values == 0 && output.count > 0 : output.count == values;
  if (!whole || (weights && output.count / values > kMaxTargets)) {
    const std::string each = weights ? fmt::format(" for each of at most {} morph targets", kMaxTargets) : "";
    sampler.fail_at("output", fmt::format("{} values{}", values, each), fmt::format("{}", output.count));
  }
}

std::optional<AnimatedPath> read_path(const JsonNode& target) {
  const std::string path = target.text("path");
  if (path == "translation") return AnimatedPath::kTranslation;
  if (path == "rotation") return AnimatedPath::kRotation;
  if (path == "scale") return AnimatedPath::kScale;
  if (path == "weights") return AnimatedPath::kWeights;
  target.warn_at("path", fmt::format("'{}' is not animated", printable(path)));
  return std::nullopt;
}

/// Animated nodes are moved by their parts, which glTF wants them to have instead of a matrix (section 3.5.3).
void read_rest_place(const JsonNode& node, RestPlace& place) {
  if (node.member("matrix").present()) {
    node.fail_at("matrix", "translation, rotation and scale of an animated node", "one");
  }
  place.translation = node.numbers<3>("translation", place.translation);
  place.rotation = node.numbers<4>("rotation", place.rotation);
  place.scale = node.numbers<3>("scale", place.scale);
}

/// `nodes`: of the document.
void read_animation(const JsonNode& node, const JsonNode& nodes, const Limits& limits, Document& document,
                    Animation& animation) {
  animation.name = node.text("name");
  const JsonNode channels = node.array("channels", limits.objects_count);
  const JsonNode samplers = node.array("samplers", limits.objects_count);
  for (uint64_t i = 0; i < channels.size() && !node.failed(); ++i) {
    const JsonNode target = channels.object_at(i).object("target");
    const auto moved = target.index("node", document.nodes.size());
    const auto path = read_path(target);
    if (!moved || !path || node.failed()) continue;
    AnimationChannel channel;
    channel.node = *moved;
    channel.path = *path;
    channel.sampler = channels.object_at(i).required_index("sampler", samplers.size());
    if (node.failed()) return;
    read_sampler(samplers.object_at(channel.sampler), document, channel);
    if (channel.path != AnimatedPath::kWeights) {
      read_rest_place(nodes.object_at(channel.node), document.rest_places[channel.node]);
    }
    animation.channels.push_back(channel);
  }
}

/// A broken one is no reason to refuse a scene that is to stand still.
void set_aside(const JsonNode& node, Document& document, uint64_t index) {
  Animation& animation = document.animations[index];
  animation.channels.clear();
  animation.broken = node.take_error().message;
  document.warnings.push_back(fmt::format("animations[{}] cannot be shown: {}", index, animation.broken));
}

}  // namespace

void read_skins_and_animations(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode skins = root.array("skins", limits.objects_count);
  document.skins.resize(skins.size());
  for (uint64_t i = 0; i < skins.size() && !root.failed(); ++i) {
    read_skin(skins.object_at(i), limits, document, document.skins[i]);
  }
  const JsonNode animations = root.array("animations", limits.objects_count);
  const JsonNode nodes = root.array("nodes", limits.objects_count);
  if (root.failed()) return;
  document.animations.resize(animations.size());
  for (uint64_t i = 0; i < animations.size(); ++i) {
    const JsonNode animation = animations.object_at(i);
    if (!root.failed()) read_animation(animation, nodes, limits, document, document.animations[i]);
    if (root.failed()) set_aside(root, document, i);
  }
}

}  // namespace shoal::gltf
