#include "engine/plan_slots.h"

#include <fmt/format.h>

#include "engine/flatten_nodes.h"
#include "engine/math.h"

namespace shoal {

namespace {

constexpr size_t kMaxTransforms = 0xffff;  // TextureSlot::transform

WrapMode wrap_mode(uint32_t gl_enum) {
  switch (gl_enum) {
    case 33071:
      return WrapMode::kClampToEdge;
    case 33648:
      return WrapMode::kMirroredRepeat;
    default:
      return WrapMode::kRepeat;
  }
}

}  // namespace

std::string material_name(const gltf::Document& document, uint32_t material) {
  const std::string& name = document.materials[material].name;
  return fmt::format("materials[{}]{}", material, name.empty() ? "" : " \"" + name + "\"");
}

Status SlotPlanner::slot(const std::optional<gltf::TextureInfo>& info, bool wanted, bool srgb, TextureSlot& out) {
  if (!info || !wanted) return {};
  const gltf::Texture& texture = document_.textures[info->texture];
  if (!texture.image) {
    plan_.warnings.push_back(fmt::format("{}: textures[{}] has no image that can be read; its factor is used alone",
                                         material_name(document_, material_), info->texture));
    return {};
  }
  SHOAL_ASSIGN_OR_RETURN(out.uv_set, uv_set(info->texcoord));
  if (info->transformed()) {
    SHOAL_ASSIGN_OR_RETURN(out.transform, transform(*info));
  }
  out.texture = request(texture, srgb);
  return {};
}

Result<uint16_t> SlotPlanner::uv_set(uint32_t texcoord) {
  MaterialUvSets& sets = plan_.uv_sets[material_];
  for (uint32_t i = 0; i < sets.count; ++i) {
    if (sets.texcoord[i] == texcoord) return static_cast<uint16_t>(i);
  }
  if (sets.count == kMaxUvSets) {
    return Error{ErrorCode::kInput, fmt::format("{}: {}: expected at most {} texture coordinate sets, found more",
                                                document_.path, material_name(document_, material_), kMaxUvSets)};
  }
  sets.texcoord[sets.count] = texcoord;
  return static_cast<uint16_t>(sets.count++);
}

/// Offset * rotation * scale. v runs down the picture, and the extension counts rotations as they are seen with v
/// upwards: (cos, sin; -sin, cos). Its example, offset (0, 1), a quarter turn and a scale of 0.5, is the lower left
/// quarter of the picture so, and nothing of it the other way round.
Result<uint16_t> SlotPlanner::transform(const gltf::TextureInfo& info) {
  const SinCos turn = sin_cos(clamped_float(info.rotation, -1e4, 1e4));
  const float su = clamped_float(info.scale[0], -1e6, 1e6), sv = clamped_float(info.scale[1], -1e6, 1e6);
  const std::array<float, 6> m = {turn.cos * su,  turn.sin * sv, clamped_float(info.offset[0], -1e6, 1e6),
                                  -turn.sin * su, turn.cos * sv, clamped_float(info.offset[1], -1e6, 1e6)};
  const auto [found, added] = transforms_.try_emplace(m, static_cast<uint16_t>(plan_.transforms.size() + 1));
  if (!added) return found->second;
  if (plan_.transforms.size() == kMaxTransforms) {
    return Error{ErrorCode::kInput, fmt::format("{}: {}: expected at most {} different texture transforms, found more",
                                                document_.path, material_name(document_, material_), kMaxTransforms)};
  }
  TextureTransform row;
  std::copy(m.begin(), m.end(), row.m);
  plan_.transforms.push_back(row);
  return found->second;
}

uint32_t SlotPlanner::request(const gltf::Texture& texture, bool srgb) {
  const gltf::Sampler sampler = texture.sampler ? document_.samplers[*texture.sampler] : gltf::Sampler{};
  TextureRequest wanted;
  wanted.image = *texture.image;
  wanted.srgb = srgb;
  wanted.wrap_u = wrap_mode(sampler.wrap_s), wanted.wrap_v = wrap_mode(sampler.wrap_t);
  wanted.nearest = sampler.nearest_magnification;
  const Key key{wanted.image, srgb, wanted.wrap_u, wanted.wrap_v, wanted.nearest};
  const auto [found, added] = known_.try_emplace(key, static_cast<uint32_t>(plan_.textures.size()));
  if (!added) return found->second;
  wanted.user = material_name(document_, material_);
  plan_.textures.push_back(std::move(wanted));
  return found->second;
}

}  // namespace shoal
