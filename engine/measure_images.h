// What the images of a scene will take in memory while they are tiled, from their headers alone, before any is decoded.
// Called by engine/build_scene. Cost: a small read an image.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/convert_materials.h"
#include "io/gltf_accessor.h"

namespace shoal {

struct ImageNeeds {
  uint64_t largest_bytes = 0;   ///< of one image while it is decoded, filtered and tiled
  uint64_t coverage_bytes = 0;  ///< alpha of all levels, kept until the treelets are built
};

/// Before anything of size is read or written. Fails with: kInput (an image is missing, of another format, or above
/// `most_pixels` by its header, named with the material that uses it), kStorage. What is broken behind its header, and a
/// JPEG whose size is not found, count for nothing here: engine/tile_textures refuses them.
Result<ImageNeeds> measure_images(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
                                  const std::vector<TextureRequest>& requests, uint64_t most_pixels);

/// Says which image and which material `error` is about.
Error image_error(const gltf::Document& document, const TextureRequest& request, const Error& error);

struct ImageHeader {
  uint32_t width = 0, height = 0;
  bool may_have_alpha = false;
};
/// Of a PNG, JPEG or WebP; zero where `bytes`, its beginning, does not say.
ImageHeader read_image_header(std::span<const std::byte> bytes);

}  // namespace shoal
