// The sections of a glTF document, each read from JSON into the plain structs of gltf_document.h. Errors stick to
// the JsonText (see gltf_json.h); the caller asks once. Later sections rely on earlier ones: call in this order.
// Called by load_document() only.
#pragma once

#include <optional>

#include "io/glb.h"
#include "io/gltf_document.h"
#include "io/gltf_json.h"

namespace shoal::gltf {

/// extensionsUsed and extensionsRequired, and a warning for each that is used and not read.
void read_extensions(const JsonNode& root, const Limits& limits, Document& document);
/// Fails with: kUnsupported.
Status check_required_extensions(const Document& document);
/// Fails with: kUnsupported (a texture whose only image is one of KHR_texture_basisu).
Status check_texture_sources(const Document& document);

/// `binary` is the BIN chunk of a .glb.
void read_buffers(const JsonNode& root, const std::optional<FileRange>& binary, const Limits& limits,
                  Document& document);
void read_accessors(const JsonNode& root, const Limits& limits, Document& document);
void read_textures(const JsonNode& root, const Limits& limits, Document& document);
void read_materials(const JsonNode& root, const Limits& limits, Document& document);
/// Far above any light, far below what could overflow a path's product of factors.
inline constexpr double kMaxRadiance = 1e10;
std::optional<TextureInfo> read_texture_info(const JsonNode& parent, const char* name, const Document& document);
/// `node` is a material.
void read_material_extensions(const JsonNode& node, const Document& document, Material& material);
void read_variants(const JsonNode& root, const Limits& limits, Document& document);
/// `node` is a primitive.
void read_variant_materials(const JsonNode& node, const Limits& limits, const Document& document,
                            Primitive& primitive);
void read_meshes(const JsonNode& root, const Limits& limits, Document& document);
/// Morph targets of a mesh: far above what is modelled, and what a file's own bytes can say of them stays small.
inline constexpr uint64_t kMaxTargets = 65536;
/// Weights of morph targets, of a mesh or a node. Fails the text when one is not a number.
std::vector<double> read_weights(const JsonNode& node);
void read_cameras_and_lights(const JsonNode& root, const Limits& limits, Document& document);
/// Nodes and the roots of the default scene; checks that they are a forest.
void read_nodes(const JsonNode& root, const Limits& limits, Document& document);
void read_skins_and_animations(const JsonNode& root, const Limits& limits, Document& document);

/// Bytes of one element, with the padding of matrix columns to 4 bytes (glTF 2.0, section 3.6.2.4).
uint64_t element_bytes(const Accessor& accessor);

}  // namespace shoal::gltf
