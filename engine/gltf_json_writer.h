// A gltf::Document as JSON text, streamed to a file: the inverse of gltf::load_document for what generated scenes
// use. Called by engine/gltf_writer. Memory: one bounded buffer, whatever the number of objects.
#pragma once

#include <span>

#include "io/file.h"
#include "io/gltf_document.h"

namespace shoal {

/// min and max of a POSITION accessor, which glTF 2.0 section 3.6.2.5 requires. Empty for other accessors.
struct PositionBounds {
  bool present = false;
  float lo[3] = {}, hi[3] = {};
};

/// Buffer::path and Image::path are written as URIs as they stand. Requires: bounds.size() == accessors.size(), no
/// sparse accessors, no embedded bytes. Fails with: kStorage.
Status write_gltf_json(const gltf::Document& document, std::span<const PositionBounds> bounds, AtomicFile& file);

}  // namespace shoal
