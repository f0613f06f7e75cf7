#include "engine/material_sample.h"

namespace shoal {

Result<Vec4> TextureContext::sample(const TextureSlot& slot, const Vec2& uv) {
  if (slot.texture == kNoIndex) return Vec4(1);
  ++lookups_count;
  const float* m = transform(slot);
  const uint32_t level =
      footprint == nullptr ? 0 : footprint->level(textures.texture(slot.texture), slot.uv_set, m);
  if (m == nullptr) return textures.sample(slot.texture, uv, level, cache_counters);
  const Vec2 moved(m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5]);
  return textures.sample(slot.texture, moved, level, cache_counters);
}

Result<Vec3> sample_emission(const Material& material, const Vec2& uv, TextureContext& context) {
  const Vec3 factor(material.emissive[0], material.emissive[1], material.emissive[2]);
  SHOAL_ASSIGN_OR_RETURN(const Vec4 texel, context.sample(material.emissive_texture, uv));
  return factor * Vec3(texel);
}

namespace {

Result<Vec4> lookup(const TextureSlot& slot, const Surface& surface, TextureContext& context) {
  if (slot.texture == kNoIndex) return Vec4(1);
  return context.sample(slot, surface.uv(slot.uv_set));
}

}  // namespace

Vec3 normal_of_texel(const Vec4& texel, float scale, const TextureSlot& slot, const Surface& surface,
                     const TextureContext& context) {
  const Vec3 n = 2.0f * Vec3(texel) - 1.0f;
  const Vec3 scaled(n.x * scale, n.y * scale, n.z);
  return facing_normal(surface, map_normal(surface, scaled, slot.uv_set, context.transform(slot)));
}

Result<Vec3> sample_base_color(const Material& material, const Surface& surface, TextureContext& context) {
  const Vec3 factor(material.base_color[0], material.base_color[1], material.base_color[2]);
  SHOAL_ASSIGN_OR_RETURN(const Vec4 base, lookup(material.base_color_texture, surface, context));
  const Vec3 color = context.vertex_colors ? Vec3(surface.color()) : Vec3(1);
  return glm::clamp(factor * color * Vec3(base), 0.0f, 1.0f);
}

Result<MaterialSample> sample_material(const Material& material, const Surface& surface, TextureContext& context) {
  MaterialSample sample;
  SHOAL_ASSIGN_OR_RETURN(sample.base_color, sample_base_color(material, surface, context));

  SHOAL_ASSIGN_OR_RETURN(const Vec4 metallic_roughness,
                         lookup(material.metallic_roughness_texture, surface, context));
  sample.roughness = glm::clamp(material.roughness * metallic_roughness.y, 0.0f, 1.0f);
  sample.metallic = glm::clamp(material.metallic * metallic_roughness.z, 0.0f, 1.0f);

  SHOAL_ASSIGN_OR_RETURN(const Vec4 specular, lookup(material.specular_texture, surface, context));
  sample.specular = glm::clamp(material.specular * specular.w, 0.0f, 1.0f);
  SHOAL_ASSIGN_OR_RETURN(const Vec4 color, lookup(material.specular_color_texture, surface, context));
  // Above 1 is allowed here (KHR_materials_specular); the product with dielectric_f0 is clamped by the BSDF.
  sample.specular_color = glm::max(
      Vec3(material.specular_color[0], material.specular_color[1], material.specular_color[2]) * Vec3(color), 0.0f);
  sample.dielectric_f0 = material.dielectric_f0;
  return sample;
}

Result<Vec3> sample_normal(const Material& material, const Surface& surface, TextureContext& context, bool mapped) {
  const TextureSlot& slot = material.normal_texture;
  if (slot.texture == kNoIndex || !mapped) return facing_normal(surface, surface.front_normal);
  SHOAL_ASSIGN_OR_RETURN(const Vec4 texel, context.sample(slot, surface.uv(slot.uv_set)));
  return normal_of_texel(texel, material.normal_scale, slot, surface, context);
}

}  // namespace shoal
