// The extensions of a material as JSON, for scenes that are written again (tiled copies). Only what differs from the
// defaults. Called by engine/gltf_json_writer. Cost: nothing.
#pragma once

#include <map>
#include <string>

#include "io/gltf_document.h"

namespace shoal {

/// The member "extensions" of a texture reference, as an object; empty when it is not transformed.
std::string texture_transform_json(const gltf::TextureInfo& info);

/// Extensions of MaterialExtensions by name, each an object.
std::map<std::string, std::string> material_extensions_json(const gltf::Material& material);

}  // namespace shoal
