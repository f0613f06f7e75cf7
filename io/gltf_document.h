// The glTF 2.0 document: the JSON of a .gltf or the JSON chunk of a .glb, parsed with nlohmann-json and checked
// into plain structs. After load() every index is in range, every accessor lies inside its view and every view
// inside its buffer by 64-bit arithmetic, the node graph is a forest of bounded depth, URIs stay inside
// the scene's folder. No buffer byte is read here (see gltf_accessor.h), no image is decoded.
// Called by engine/build_scene. A document is immutable after load().
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"
#include "io/scratch_file.h"

namespace shoal::gltf {

/// Budgets against hostile input; over a budget is ErrorCode::kInput.
struct Limits {
  uint64_t json_bytes = 1ull << 30;
  uint64_t json_values_count = 1ull << 26;  ///< of the whole document
  uint64_t objects_count = 1ull << 24;      ///< of each array of the document
  uint32_t node_depth = 512;
  uint64_t instances_count = 1ull << 24;    ///< nodes with meshes, after flattening
  uint64_t image_pixels = 1ull << 28;       ///< of one image
};

enum class ComponentType : uint16_t {
  kByte = 5120,
  kUnsignedByte,
  kShort,
  kUnsignedShort,
  kUnsignedInt = 5125,
  kFloat
};
uint32_t component_bytes(ComponentType type);

struct Buffer {
  uint64_t byte_length = 0;
  std::string path;         ///< of an external file; empty: embedded
  uint64_t path_offset = 0; ///< where the bytes begin (a .glb's BIN chunk: the .glb itself)
  std::vector<std::byte> embedded;  ///< decoded data: URI
  std::shared_ptr<ScratchFile> scratch;  ///< where decompress() put the bytes; null: it did not
  bool placeholder = false;  ///< EXT_meshopt_compression's fallback: nothing is read from it
};

struct BufferView {
  uint32_t buffer = 0;
  uint64_t byte_offset = 0, byte_length = 0;
  uint32_t byte_stride = 0;  ///< 0: tightly packed
  std::optional<uint32_t> meshopt;  ///< of Document::meshopt_views: its bytes are not there before decompress()
};

/// EXT_meshopt_compression of a buffer view.
enum class MeshoptMode : uint8_t { kAttributes, kTriangles, kIndices };
enum class MeshoptFilter : uint8_t { kNone, kOctahedral, kQuaternion, kExponential };
struct MeshoptView {
  uint32_t buffer = 0;
  uint64_t byte_offset = 0, byte_length = 0;  ///< compressed
  uint64_t count = 0;
  uint32_t byte_stride = 0;
  MeshoptMode mode = MeshoptMode::kAttributes;
  MeshoptFilter filter = MeshoptFilter::kNone;
};

/// KHR_draco_mesh_compression of a primitive.
struct DracoPrimitive {
  uint32_t view = 0;
  std::map<std::string, uint32_t> attributes;  ///< name -> unique id in the compressed mesh
  auto operator<=>(const DracoPrimitive&) const = default;
};

struct SparseAccessor {
  uint64_t count = 0;
  uint32_t indices_view = 0;
  uint64_t indices_offset = 0;
  ComponentType indices_type = ComponentType::kUnsignedInt;
  uint32_t values_view = 0;
  uint64_t values_offset = 0;
};

struct Accessor {
  std::optional<uint32_t> view;  ///< none: zeros (then sparse values)
  uint64_t byte_offset = 0;
  uint64_t count = 0;
  uint32_t components = 1;       ///< 1 SCALAR, 2, 3, 4 VECn, 4 MAT2, 9 MAT3, 16 MAT4
  bool matrix = false;
  ComponentType type = ComponentType::kFloat;
  bool normalized = false;
  std::optional<SparseAccessor> sparse;
};

enum class PrimitiveMode : uint8_t {
  kPoints,
  kLines,
  kLineLoop,
  kLineStrip,
  kTriangles,
  kTriangleStrip,
  kTriangleFan
};

/// KHR_materials_variants: the material of a primitive in some variants.
struct VariantMaterial {
  uint32_t material = 0;
  std::vector<uint32_t> variants;  ///< indices into Document::variants
};

/// Displacements of a primitive's vertices, as accessors.
struct MorphTarget {
  std::optional<uint32_t> position, normal, tangent;
};

struct Primitive {
  std::map<std::string, uint32_t> attributes;  ///< POSITION, NORMAL, TEXCOORD_0, ... -> accessor
  std::optional<uint32_t> indices;
  std::optional<uint32_t> material;
  std::optional<uint32_t> draco;  ///< of Document::draco_primitives: its accessors are empty before decompress()
  PrimitiveMode mode = PrimitiveMode::kTriangles;
  std::vector<VariantMaterial> variant_materials;
  std::vector<MorphTarget> targets;
};

/// Of each joint of a skin: its world matrix times its inverse bind matrix, columns x, y, z and translation.
using JointMatrices = std::vector<std::array<double, 12>>;

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  std::vector<double> weights;  ///< of the morph targets; posed: those of the one node that shows it so
  std::shared_ptr<const JointMatrices> joints;  ///< put there by engine/pose_document; null: not skinned
};

struct Skin {
  std::vector<uint32_t> joints;  ///< nodes
  std::optional<uint32_t> inverse_bind;
};

enum class Interpolation : uint8_t { kStep, kLinear, kCubicSpline };
enum class AnimatedPath : uint8_t { kTranslation, kRotation, kScale, kWeights };
struct AnimationChannel {
  uint32_t node = 0, sampler = 0;
  uint32_t input = 0, output = 0;  ///< accessors of times and values
  Interpolation interpolation = Interpolation::kLinear;
  AnimatedPath path = AnimatedPath::kTranslation;
};
struct Animation {
  std::string name;
  std::string broken;  ///< why it cannot be shown, with its place; empty: it can
  std::vector<AnimationChannel> channels;
};

/// Where a node is while nothing moves it.
struct RestPlace {
  std::array<double, 3> translation{0, 0, 0};
  std::array<double, 4> rotation{0, 0, 0, 1};
  std::array<double, 3> scale{1, 1, 1};
};

struct TextureInfo {
  uint32_t texture = 0;
  uint32_t texcoord = 0;
  std::array<double, 2> offset{0, 0}, scale{1, 1};  ///< KHR_texture_transform: scaled, then rotated, then moved
  double rotation = 0;                              ///< radians

  bool transformed() const {
    return offset != std::array<double, 2>{0, 0} || scale != std::array<double, 2>{1, 1} || rotation != 0;
  }
};

/// Extensions that add lobes to a material or take some away; the defaults do nothing.
struct MaterialExtensions {
  bool unlit = false;                      ///< KHR_materials_unlit
  double transmission = 0;                 ///< KHR_materials_transmission
  bool has_volume = false;                 ///< KHR_materials_volume with a thickness above 0
  double attenuation_distance = 0;         ///< world units; 0: infinite, nothing is absorbed
  std::array<double, 3> attenuation_color{1, 1, 1};
  double dispersion = 0;                   ///< KHR_materials_dispersion: 20 / Abbe number
  double clearcoat = 0, clearcoat_roughness = 0, clearcoat_normal_scale = 1;
  std::array<double, 3> sheen_color{0, 0, 0};
  double sheen_roughness = 0;
  double anisotropy = 0, anisotropy_rotation = 0;
  double iridescence = 0, iridescence_ior = 1.3, film_minimum = 100, film_maximum = 400;  ///< thickness in nm
  double diffuse_transmission = 0;
  std::array<double, 3> diffuse_transmission_color{1, 1, 1};
  std::optional<TextureInfo> transmission_texture, clearcoat_texture, clearcoat_roughness_texture,
      clearcoat_normal_texture, sheen_color_texture, sheen_roughness_texture, anisotropy_texture,
      iridescence_texture, film_texture, diffuse_transmission_texture, diffuse_transmission_color_texture;
};

enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };

struct Material {
  std::string name;
  std::array<double, 4> base_color{1, 1, 1, 1};
  double metallic = 1, roughness = 1;
  std::array<double, 3> emissive{0, 0, 0};
  double emissive_strength = 1;            ///< KHR_materials_emissive_strength
  double specular = 1;                     ///< KHR_materials_specular
  std::array<double, 3> specular_color{1, 1, 1};
  double ior = 1.5;                        ///< KHR_materials_ior
  double normal_scale = 1;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  double alpha_cutoff = 0.5;
  bool double_sided = false;
  std::optional<TextureInfo> base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture,
      specular_texture, specular_color_texture;
  MaterialExtensions more;
};

struct Sampler {
  bool nearest_magnification = false;
  uint32_t wrap_s = 10497, wrap_t = 10497;  ///< 33071 clamp, 33648 mirror, 10497 repeat
};

struct Image {
  std::string name;                 ///< for messages: URI or "image N"
  std::string path;                 ///< external file, else empty
  std::optional<uint32_t> view;     ///< a buffer view
  std::vector<std::byte> embedded;  ///< data: URI
};

struct Texture {
  std::optional<uint32_t> sampler, image;
  bool basisu = false;  ///< KHR_texture_basisu names an image, which is not read
};

struct Camera {
  std::string name;
  bool perspective = true;
  double yfov = 0.8, aspect_ratio = 0;      ///< 0: from the picture
  double xmag = 1, ymag = 1;
};

enum class LightType : uint8_t { kDirectional, kPoint, kSpot };
struct Light {                               // KHR_lights_punctual
  std::string name;
  LightType type = LightType::kPoint;
  std::array<double, 3> color{1, 1, 1};
  double intensity = 1;                      ///< candela, directional: lux
  double inner_cone = 0, outer_cone = 0.7853981633974483;
  double range = 0;                          ///< of points and spots; 0: none
};

struct Node {
  std::string name;
  std::vector<uint32_t> children;
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  ///< column-major, TRS composed
  std::optional<uint32_t> mesh, camera, light, skin;
};

/// EXT_mesh_gpu_instancing: accessors of what each instance adds below its node.
struct Instancing {
  uint64_t count = 0;
  std::optional<uint32_t> translation, rotation, scale;
};

struct Document {
  std::string path;       ///< of the .gltf or .glb
  std::string folder;
  uint64_t content_hash = 0;  ///< XXH3 of the JSON
  std::vector<std::string> extensions_used, extensions_required;
  std::vector<std::string> warnings;  ///< for the log: unknown extensions used, ...
  std::vector<uint32_t> roots;        ///< nodes of the default scene (or all parentless nodes)
  std::vector<Buffer> buffers;
  std::vector<BufferView> views;
  std::vector<MeshoptView> meshopt_views;
  std::vector<DracoPrimitive> draco_primitives;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Material> materials;
  std::vector<Sampler> samplers;
  std::vector<Image> images;
  std::vector<Texture> textures;
  std::vector<Camera> cameras;
  std::vector<Light> lights;
  std::vector<Node> nodes;
  std::vector<std::string> variants;  ///< KHR_materials_variants: names
  std::vector<Skin> skins;
  std::vector<Animation> animations;
  std::map<uint32_t, RestPlace> rest_places;             ///< of the nodes that an animation moves
  std::map<uint32_t, std::vector<double>> node_weights;  ///< of morph targets, where the node has its own
  std::map<uint32_t, Instancing> instancings;  ///< by node; nodes that show a mesh only
};

/// Translation * rotation * scale, column-major. The quaternion is normalised: exporters round it. Requires: it is not 0.
std::array<double, 16> compose_matrix(const std::array<double, 3>& translation, const std::array<double, 4>& rotation,
                                      const std::array<double, 3>& scale);

/// Fails with: kInput (missing, truncated, malformed, over a budget; names file and JSON place such as
/// "accessors[3].count"), kUnsupported (extensionsRequired that are not read, named with what to do).
Result<Document> load_document(FileSystem& fs, const std::string& path, const Limits& limits = {});
/// Gives every primitive the material that it has in the variant of that name; the first of two with one name.
/// Fails with: kUsage (no such variant; those there are are named).
Status select_variant(Document& document, const std::string& name);
/// What variants would show: not needed once the materials are chosen, and copied with every mesh.
void forget_variants(Document& document);

/// Document::content_hash of the file as it is now, without reading it as JSON: a block at a time, so any size will do.
/// Fails with: kInput (missing, a malformed .glb), kStorage.
Result<uint64_t> json_hash(FileSystem& fs, const std::string& path);

/// The extensions that are read: in extensionsRequired these are accepted.
bool extension_supported(const std::string& name);

}  // namespace shoal::gltf
