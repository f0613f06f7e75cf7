// The binary container of glTF (.glb): a header and chunks, of which JSON comes first and BIN may follow.
// Only positions are found here; nothing but the headers is read. Called by the glTF reader.
#pragma once

#include <cstdint>
#include <optional>

#include "io/file.h"
#include "io/result.h"

namespace shoal::gltf {

struct FileRange {
  uint64_t offset = 0, bytes = 0;
};

struct GlbChunks {
  FileRange json;
  std::optional<FileRange> binary;
};

/// Nothing when the file does not begin with the magic of a .glb. Fails with: kInput (a version other than 2,
/// chunks that leave the file, no JSON chunk), kStorage.
Result<std::optional<GlbChunks>> find_glb_chunks(ReadableFile& file);

}  // namespace shoal::gltf
