// The tables of a .shoal file that stay resident while rendering: plain structs, stored as they are
// (little-endian, docs/file_format.md). Written by engine/build_scene, read and checked by engine/open_scene.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "io/page_file.h"
#include "treelets/coverage.h"
#include "treelets/top_tree.h"

namespace shoal {

namespace tables {
inline constexpr TableId kBuildRecord = 1;   ///< JSON: version, source, options, counts (for people and `info`)
inline constexpr TableId kSceneHeader = 2;   ///< one SceneHeader
inline constexpr TableId kTopNodes = 3;      ///< TopNode[]
inline constexpr TableId kEntries = 4;       ///< TreeletEntry[]
inline constexpr TableId kInstances = 5;     ///< Instance[]
inline constexpr TableId kTreelets = 6;      ///< TreeletPages[]
inline constexpr TableId kMaterials = 7;     ///< Material[]
inline constexpr TableId kTextures = 8;      ///< Texture[]
inline constexpr TableId kEmitters = 9;      ///< Emitter[]
inline constexpr TableId kLights = 10;       ///< PunctualLight[]
inline constexpr TableId kCameras = 11;      ///< CameraRecord[]
inline constexpr TableId kNames = 12;        ///< JSON: names of materials, cameras, lights, for messages
inline constexpr TableId kSourceFiles = 13;  ///< engine/source_files.h; absent from files of earlier versions
inline constexpr TableId kMaterialLayers = 14;     ///< MaterialLayers[]
inline constexpr TableId kTextureTransforms = 15;  ///< TextureTransform[]
inline constexpr TableId kCameraKeys = 16;         ///< Affine3[]: where cameras that move stand
inline constexpr TableId kBakedMeshes = 20;        ///< words: first primitive of each (engine/object_ids.h); may be absent
}  // namespace tables

struct SceneHeader {
  uint32_t version = 5;
  uint32_t treelet_bytes = 0;        ///< --treelet-size of the build
  uint64_t triangles_count = 0;      ///< stored, an instanced mesh once
  uint64_t instanced_triangles_count = 0;
  uint64_t degenerate_count = 0;
  uint64_t geometry_bytes = 0;       ///< decoded treelet pages
  uint64_t attribute_bytes = 0;
  uint64_t texture_bytes = 0;
  uint64_t content_hash = 0;         ///< of the sources
  float bounds_lo[3], bounds_hi[3];  ///< world
  uint32_t largest_treelet_bytes = 0, largest_attribute_bytes = 0;
  uint32_t position_bits = 0;        ///< PositionPrecision (engine/position_grid.h)
  float position_step = 0;           ///< of the coarsest grid; 0: no position was rounded
  float position_error = 0;          ///< how far a point was moved at most, world
  uint32_t bvh_builder = 0;          ///< BvhBuilder (treelets/bvh_builder_kind.h)
};
static_assert(sizeof(SceneHeader) == 112);

/// Geometry pages ascend from treelet to treelet, so that a page finds its treelet by binary search; the attribute
/// page, if any, is the page after the geometry page.
struct TreeletPages {
  PageId geometry = kNoPage;
  PageId attributes = kNoPage;   ///< kNoPage: none
  uint32_t triangle_count = 0;   ///< of the geometry page and of the attribute page
};

struct TextureSlot {
  uint32_t texture = kNoIndex;  ///< kNoIndex: none, the factor alone
  uint16_t uv_set = 0;          ///< of CornerAttributes::uv
  uint16_t transform = 0;       ///< row + 1 of the texture transforms; 0: none
};

/// KHR_texture_transform: u' = m[0] u + m[1] v + m[2], v' = m[3] u + m[4] v + m[5].
struct TextureTransform {
  float m[6];
};

enum MaterialFlags : uint32_t {
  kMaterialEmits = 1,         ///< emissive factor > 0 in some channel
  kMaterialLambert = 2,       ///< metallic 0, specular 0, no effects, no texture but emission's
  kMaterialVertexColors = 4,  ///< some triangle with it has vertex colours; for the effects plan alone
};
inline constexpr uint32_t kAllMaterialFlags = 7;

/// What a material calls for beyond the factors and textures of every material. The bits of kLayerEffects need a
/// row of MaterialLayers; a material without them is shaded by the plain code (engine/bsdf.h).
enum MaterialEffects : uint32_t {
  kEffectTransmission = 1u << 0,         ///< light passes the surface: thin-walled, or refracted into a volume
  kEffectVolume = 1u << 1,               ///< the surface bounds a volume: refraction and absorption
  kEffectDispersion = 1u << 2,
  kEffectDiffuseTransmission = 1u << 3,
  kEffectClearcoat = 1u << 4,
  kEffectSheen = 1u << 5,
  kEffectAnisotropy = 1u << 6,
  kEffectIridescence = 1u << 7,
  kEffectUnlit = 1u << 8,                ///< shows its base colour, scatters nothing; no row
  kEffectNormalMap = 1u << 9,            ///< no row
  kEffectTextureTransform = 1u << 10,    ///< of some texture; no row
};
inline constexpr uint32_t kLayerEffects = 0xff;
inline constexpr uint32_t kAllMaterialEffects = 0x7ff;

struct Material {
  float base_color[4];
  float emissive[3];         ///< factor times strength, cd/m^2 in the file's terms: radiance
  float metallic;
  float specular_color[3];
  float specular;            ///< KHR_materials_specular
  float roughness;           ///< perceptual; alpha = roughness^2
  float dielectric_f0;       ///< ((ior - 1) / (ior + 1))^2
  float normal_scale;
  float alpha_cutoff;
  float emission_weight;     ///< mean luminance of the emission over its texture, for light sampling
  uint32_t flags;            ///< MaterialFlags
  CoverageMode coverage;
  uint8_t reserved8[3];
  TextureSlot base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture, specular_texture,
      specular_color_texture;
  uint32_t effects;  ///< MaterialEffects
  uint32_t layers;   ///< row of the material layers; kNoIndex: none
  uint32_t reserved[2];
};
static_assert(sizeof(Material) == 140);

/// The parameters of a material's layers, for materials that have some. The values here change nothing.
struct MaterialLayers {
  float ior = 1.5f;
  float transmission = 0;
  float dispersion = 0;  ///< 20 / Abbe number
  uint32_t volume = 0;   ///< 1: the surface bounds a volume, 0: it is thin-walled
  float absorption[3] = {0, 0, 0};  ///< log2 of what a world unit of the volume lets pass, <= 0
  float clearcoat = 0, clearcoat_roughness = 0, clearcoat_normal_scale = 1;
  float sheen_color[3] = {0, 0, 0};
  float sheen_roughness = 0;
  float anisotropy = 0, anisotropy_cos = 1, anisotropy_sin = 0;  ///< strength, and its rotation from the tangent
  float iridescence = 0, iridescence_ior = 1.3f, film_minimum = 100, film_maximum = 400;  ///< thickness in nm
  float diffuse_transmission = 0;
  float diffuse_transmission_color[3] = {1, 1, 1};
  TextureSlot transmission_texture, clearcoat_texture, clearcoat_roughness_texture, clearcoat_normal_texture,
      sheen_color_texture, sheen_roughness_texture, anisotropy_texture, iridescence_texture, film_texture,
      diffuse_transmission_texture, diffuse_transmission_color_texture;
  uint32_t reserved = 0;
};
static_assert(sizeof(MaterialLayers) == 192);

/// All slots of a row, as pointers, to be read or (of a row that is not const) changed.
template <class M>
  requires std::same_as<std::remove_const_t<M>, Material>
auto texture_slots(M& m) {
  return std::array{&m.base_color_texture, &m.metallic_roughness_texture, &m.normal_texture,
                    &m.emissive_texture,   &m.specular_texture,           &m.specular_color_texture};
}
template <class L>
  requires std::same_as<std::remove_const_t<L>, MaterialLayers>
auto texture_slots(L& l) {
  return std::array{&l.transmission_texture,        &l.clearcoat_texture,
                    &l.clearcoat_roughness_texture, &l.clearcoat_normal_texture,
                    &l.sheen_color_texture,         &l.sheen_roughness_texture,
                    &l.anisotropy_texture,          &l.iridescence_texture,
                    &l.film_texture,                &l.diffuse_transmission_texture,
                    &l.diffuse_transmission_color_texture};
}

inline constexpr uint32_t kTextureTileTexels = 64;  ///< a tile is 64 x 64 RGBA8: 16 KiB decoded
inline constexpr uint32_t kMaxTextureLevels = 17;   ///< 65536 texels a side

/// A texture: mip pyramid of tiles, each a kTexture page; tiles row by row, level by level from first_page.
/// A tile at the border is padded by repeating its last texel (never read).
struct Texture {
  uint32_t width = 0, height = 0;
  uint32_t level_count = 0;      ///< level l is max(1, width >> l) by max(1, height >> l)
  PageId first_page[kMaxTextureLevels] = {};
  uint8_t srgb = 0;              ///< colour channels are sRGB-encoded (alpha never is)
  WrapMode wrap_u = WrapMode::kRepeat, wrap_v = WrapMode::kRepeat;
  uint8_t nearest = 0;
};

/// An emissive triangle in world space, of an instance that moves in its object's; in order of (instance, primitive).
struct Emitter {
  float position[9];
  float uv[6];          ///< of the emissive texture's set
  uint32_t material;
  uint32_t instance;
  uint32_t primitive;
};

enum class PunctualType : uint32_t { kDirectional, kPoint, kSpot };
struct PunctualLight {
  PunctualType type;
  float position[3];
  float direction[3];      ///< the way the light goes, unit
  float intensity[3];      ///< colour times candela (point, spot) or lux (directional)
  float cos_inner, cos_outer;
  float range = 0;         ///< point, spot: where the light ends; 0: nowhere
};

struct CameraRecord {
  Affine3 camera_to_world;   ///< glTF: looks along -z, y up, unit columns not required
  uint32_t perspective;      ///< 0: orthographic
  float tan_half_yfov;
  float aspect_ratio;        ///< 0: from the picture
  float xmag, ymag;
  uint32_t first_key, key_count;  ///< of the camera keys, if it moves: camera_to_world at even times; else 0
};

}  // namespace shoal
