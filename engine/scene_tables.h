// The tables of a .shoal file that stay resident while rendering: plain structs, stored as they are
// (little-endian, docs/file_format.md). Written by engine/build_scene, read and checked by engine/open_scene.
#pragma once

#include <cstdint>

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
}  // namespace tables

struct SceneHeader {
  uint32_t version = 2;
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
  uint32_t reserved[4] = {};
};

/// Geometry pages ascend from treelet to treelet, so that a page finds its treelet by binary search; the attribute
/// page, if any, is the page after the geometry page.
struct TreeletPages {
  PageId geometry = kNoPage;
  PageId attributes = kNoPage;   ///< kNoPage: none
  uint32_t triangle_count = 0;   ///< of the geometry page and of the attribute page
};

struct TextureSlot {
  uint32_t texture = kNoIndex;  ///< kNoIndex: none, the factor alone
  uint32_t uv_set = 0;          ///< of CornerAttributes::uv
};

enum MaterialFlags : uint32_t {
  kMaterialEmits = 1,      ///< emissive factor > 0 in some channel
};

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
  uint32_t reserved[4];
};

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

/// An emissive triangle in world space, in order of (instance, primitive).
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
};

struct CameraRecord {
  Affine3 camera_to_world;   ///< glTF: looks along -z, y up, unit columns not required
  uint32_t perspective;      ///< 0: orthographic
  float tan_half_yfov;
  float aspect_ratio;        ///< 0: from the picture
  float xmag, ymag;
};

}  // namespace shoal
