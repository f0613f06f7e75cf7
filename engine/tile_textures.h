// Images to pages: each image that a material needs is decoded once, filtered into a mip pyramid and cut into 64 x
// 64 tiles, one kTexture page each. Textures that differ in their sampler only share pages. Called by
// engine/build_scene from one thread. Cost: the decoder's, and 15 bytes a texel of one image at a time.
#pragma once

#include <functional>
#include <vector>

#include "engine/convert_materials.h"
#include "engine/coverage_textures.h"
#include "io/gltf_accessor.h"
#include "io/page_file.h"

namespace shoal {

inline constexpr uint32_t kTextureTileBytes = kTextureTileTexels * kTextureTileTexels * 4;
/// Of an image while it is decoded, filtered and tiled: 4 decoded, 4 a copy for a second encoding, 4 + 1 float
/// levels, rounded up.
inline constexpr uint64_t kImageScratchBytesPerPixel = 15;
inline constexpr uint64_t kMaxEncodedImageBytes = 1u << 30;
inline constexpr uint32_t kMaxTextureSide = 1u << (kMaxTextureLevels - 1);

struct TiledTextures {
  std::vector<Texture> textures;    ///< parallel to the requests
  std::vector<TextureFacts> facts;  ///< likewise
  uint64_t pages_bytes = 0;         ///< decoded
  uint64_t source_bytes = 0;        ///< of encoded images
};

/// `progress` is called with the fraction done. Fails with: kInput (an image missing, broken or over a budget,
/// named with the material that uses it), kStorage.
Result<TiledTextures> tile_textures(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
                                    const std::vector<TextureRequest>& requests, const gltf::Limits& limits,
                                    PageFileWriter& writer, CoverageTextures& coverage,
                                    const std::function<void(double)>& progress);

}  // namespace shoal
