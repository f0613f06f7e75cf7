// glTF materials to the renderer's: factors, texture slots, UV sets renumbered, coverage. In two steps, because
// emission weights and coverage need the texels: plan_materials() says which textures are needed and how,
// engine/tile_textures reads them, finish_materials() completes the materials.
// Called by engine/build_scene. Cost: nothing.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene_tables.h"
#include "io/gltf_document.h"
#include "io/result.h"

namespace shoal {

inline constexpr uint32_t kMaxUvSets = 4;  ///< of CornerAttributes::uv

/// Which TEXCOORD_n each of a material's uv sets is.
struct MaterialUvSets {
  uint32_t count = 0;
  std::array<uint32_t, kMaxUvSets> texcoord{};
};

/// What the geometry asks of one material.
struct MaterialUse {
  bool used = false;
  bool vertex_colors = false;  ///< some primitive with it has a COLOR_0
  bool vertex_alpha = false;  ///< some primitive with it has a COLOR_0 with alpha
};

/// One Texture of the file: an image as a sampler and an encoding see it.
struct TextureRequest {
  uint32_t image = 0;
  bool srgb = false;
  WrapMode wrap_u = WrapMode::kRepeat, wrap_v = WrapMode::kRepeat;
  bool nearest = false;
  bool needs_alpha = false;  ///< for coverage: its alpha is kept in memory during the build
  std::string user;          ///< a material, for messages
  bool operator==(const TextureRequest&) const = default;
};

struct MaterialPlan {
  std::vector<Material> materials;      ///< document order; the default material last, if used
  std::vector<MaterialLayers> layers;   ///< of the materials that call for some, in their order
  std::vector<TextureTransform> transforms;  ///< each once
  std::vector<MaterialUvSets> uv_sets;  ///< parallel
  std::vector<TextureRequest> textures;
  std::vector<std::string> warnings;
  uint32_t default_material = kNoIndex;

  /// Whether a material asks for the tangents of its meshes: for a normal map or a direction of anisotropy.
  bool wants_tangents(uint32_t material) const {
    const Material& m = materials[material];
    return ((m.effects & (kEffectNormalMap | kEffectAnisotropy)) != 0) || m.normal_texture.texture != kNoIndex;
  }
  uint32_t material_of(const gltf::Primitive& primitive) const {
    return primitive.material ? *primitive.material : default_material;
  }
};

/// What finish_materials() needs to know of a texture.
struct TextureFacts {
  double mean[4] = {1, 1, 1, 1};  ///< linear
  bool opaque = true;             ///< every alpha is 255
};

/// `uses` has one element a document material and one more for the default material.
/// Fails with: kInput (more than kMaxUvSets texture coordinate sets in a material, too many texture transforms).
Result<MaterialPlan> plan_materials(const gltf::Document& document, const std::vector<MaterialUse>& uses);

void finish_materials(MaterialPlan& plan, const std::vector<TextureFacts>& textures,
                      const std::vector<MaterialUse>& uses);

}  // namespace shoal
