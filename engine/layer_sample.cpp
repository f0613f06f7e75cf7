// The layers of a material at a point of a surface: the rows of engine/scene_tables.h times their textures.
#include "engine/material_sample.h"

namespace shoal {
namespace {

/// Looks textures up one after the other; after an error the others are white and the error stays.
class LayerReader {
 public:
  LayerReader(const Surface& surface, TextureContext& context) : surface_(surface), context_(context) {}

  Vec4 texel(const TextureSlot& slot) {
    if (slot.texture == kNoIndex || !status_.ok()) return Vec4(1);
    auto found = context_.sample(slot, surface_.uv(slot.uv_set));
    if (found.ok()) return found.value();
    status_ = found.error();
    return Vec4(1);
  }
  Status status() const { return status_; }

 private:
  const Surface& surface_;
  TextureContext& context_;
  Status status_;
};

float unit(float v) { return glm::clamp(v, 0.0f, 1.0f); }
Vec3 vector3(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

void read_coat(const MaterialLayers& l, const Surface& surface, bool normal_mapped, LayerReader& reader,
               TextureContext& context, LayeredSample& out) {
  out.clearcoat = unit(l.clearcoat * reader.texel(l.clearcoat_texture).x);
  out.clearcoat_roughness = unit(l.clearcoat_roughness * reader.texel(l.clearcoat_roughness_texture).y);
  // Without a map of its own the coat has the normal of the vertices, whatever lies below (the extension).
  out.clearcoat_normal = facing_normal(surface, surface.front_normal);
  const TextureSlot& slot = l.clearcoat_normal_texture;
  if (slot.texture == kNoIndex || !normal_mapped) return;
  out.clearcoat_normal = normal_of_texel(reader.texel(slot), l.clearcoat_normal_scale, slot, surface, context);
}

void read_anisotropy(const MaterialLayers& l, const Material& material, const Surface& surface, LayerReader& reader,
                     TextureContext& context, LayeredSample& out) {
  Vec2 direction(1, 0);
  float strength = l.anisotropy;
  if (l.anisotropy_texture.texture != kNoIndex) {
    const Vec4 texel = reader.texel(l.anisotropy_texture);
    const Vec2 encoded(2 * texel.x - 1, 2 * texel.y - 1);
    const float length2 = glm::dot(encoded, encoded);
    if (length2 > 0) direction = encoded / std::sqrt(length2);
    strength *= texel.z;
  }
  out.anisotropy = unit(strength);
  const Vec2 turned(l.anisotropy_cos * direction.x - l.anisotropy_sin * direction.y,
                    l.anisotropy_sin * direction.x + l.anisotropy_cos * direction.y);
  // Tangents go with the normal texture where the mesh has none (the extension); else with the anisotropy's.
  const TextureSlot& slot =
      material.normal_texture.texture != kNoIndex ? material.normal_texture : l.anisotropy_texture;
  const TangentFrame frame = tangent_frame(surface, slot.uv_set, context.transform(slot));
  out.anisotropy_direction = frame.tangent * turned.x + frame.bitangent * turned.y;
}

}  // namespace

Status sample_layers(const MaterialLayers& l, const Material& material, uint32_t effects, const Surface& surface,
                     TextureContext& context, LayeredSample& out) {
  LayerReader reader(surface, context);
  const auto calls = [effects](uint32_t effect) { return (effects & effect) != 0; };
  out.ior = l.ior;
  out.outside = surface.front;
  if (calls(kEffectTransmission)) out.transmission = unit(l.transmission * reader.texel(l.transmission_texture).x);
  if (calls(kEffectVolume)) out.volume = l.volume != 0;
  if (calls(kEffectDiffuseTransmission)) {
    out.diffuse_transmission = unit(l.diffuse_transmission * reader.texel(l.diffuse_transmission_texture).w);
    const Vec4 color = reader.texel(l.diffuse_transmission_color_texture);
    out.diffuse_transmission_color = vector3(l.diffuse_transmission_color) * Vec3(color);
  }
  if (calls(kEffectClearcoat)) read_coat(l, surface, calls(kEffectNormalMap), reader, context, out);
  if (calls(kEffectSheen)) {
    out.sheen_color = vector3(l.sheen_color) * Vec3(reader.texel(l.sheen_color_texture));
    out.sheen_roughness = unit(l.sheen_roughness * reader.texel(l.sheen_roughness_texture).w);
  }
  if (calls(kEffectAnisotropy)) read_anisotropy(l, material, surface, reader, context, out);
  if (calls(kEffectIridescence)) {
    out.iridescence = unit(l.iridescence * reader.texel(l.iridescence_texture).x);
    out.film_ior = l.iridescence_ior;
    const bool varies = l.film_texture.texture != kNoIndex;
    const float share = varies ? reader.texel(l.film_texture).y : 1.0f;
    out.film_thickness = l.film_minimum + share * (l.film_maximum - l.film_minimum);
  }
  return reader.status();
}

}  // namespace shoal
