#include "engine/tile_textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "engine/measure_images.h"
#include "engine/mip_pyramid.h"

namespace shoal {

namespace {

Result<std::vector<std::byte>> encoded_image(FileSystem& fs, gltf::BufferFiles& files,
                                             const gltf::Document& document, const gltf::Image& image) {
  std::vector<std::byte> bytes;
  if (image.view) {
    const gltf::BufferView& view = document.views[*image.view];
    if (view.byte_length > kMaxEncodedImageBytes) {
      return Error{ErrorCode::kInput, fmt::format("expected at most {} encoded bytes, found {}",
                                                  kMaxEncodedImageBytes, view.byte_length)};
    }
    bytes.resize(view.byte_length);
    SHOAL_RETURN_IF_ERROR(files.read(view.buffer, view.byte_offset, bytes));
  } else if (!image.path.empty()) {
    SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(fs, image.path, kMaxEncodedImageBytes));
    bytes.resize(text.size());
    if (!text.empty()) std::memcpy(bytes.data(), text.data(), text.size());
  } else {
    bytes = image.embedded;
  }
  return bytes;
}

/// Writes one level as tiles; the last row and column of a tile at the border repeat.
Result<PageId> write_level(const Image8& level, PageFileWriter& writer, uint64_t& pages_bytes) {
  std::vector<std::byte> tile(kTextureTileBytes);
  PageId first = kNoPage;
  for (uint32_t y0 = 0; y0 < level.height; y0 += kTextureTileTexels) {
    for (uint32_t x0 = 0; x0 < level.width; x0 += kTextureTileTexels) {
      for (uint32_t y = 0; y < kTextureTileTexels; ++y) {
        const uint32_t row = std::min(y0 + y, level.height - 1);
        for (uint32_t x = 0; x < kTextureTileTexels; ++x) {
          const uint32_t column = std::min(x0 + x, level.width - 1);
          std::memcpy(&tile[size_t{4} * (y * kTextureTileTexels + x)],
                      &level.rgba[(size_t{row} * level.width + column) * 4], 4);
        }
      }
      SHOAL_ASSIGN_OR_RETURN(const PageId page, writer.append(PageKind::kTexture, tile));
      if (first == kNoPage) first = page;
      pages_bytes += kTextureTileBytes;
    }
  }
  return first;
}

AlphaLevel alpha_of(const Image8& level) {
  AlphaLevel out{level.width, level.height, {}};
  out.alpha.resize(level.rgba.size() / 4);
  for (size_t i = 0; i < out.alpha.size(); ++i) out.alpha[i] = level.rgba[4 * i + 3];
  return out;
}

bool all_opaque(const Image8& image) {
  if (!image.has_alpha) return true;
  for (size_t i = 3; i < image.rgba.size(); i += 4) {
    if (image.rgba[i] != 255) return false;
  }
  return true;
}

class TextureTiler {
 public:
  TextureTiler(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
               const std::vector<TextureRequest>& requests, uint64_t max_pixels, PageFileWriter& writer,
               CoverageTextures& coverage)
      : fs_(fs),
        files_(files),
        document_(document),
        requests_(requests),
        max_pixels_(max_pixels),
        writer_(writer),
        coverage_(coverage) {
    out_.textures.resize(requests.size());
    out_.facts.resize(requests.size());
  }

  /// All requests for one image: `of_image` indexes requests.
  Status tile_image(const std::vector<uint32_t>& of_image) {
    const TextureRequest& first = requests_[of_image.front()];
    const gltf::Image& source = document_.images[first.image];
    auto decoded = decode(source);
    if (!decoded.ok()) return image_error(document_, first, decoded.error());
    Image8 image = std::move(decoded).value();
    std::vector<uint32_t> encoded[2];
    for (const uint32_t r : of_image) encoded[requests_[r].srgb].push_back(r);
    if (encoded[0].empty()) return tile_pyramid(std::move(image), encoded[1]);
    if (!encoded[1].empty()) SHOAL_RETURN_IF_ERROR(tile_pyramid(Image8(image), encoded[1]));
    return tile_pyramid(std::move(image), encoded[0]);
  }

  TiledTextures take() { return std::move(out_); }

 private:
  Result<Image8> decode(const gltf::Image& source) {
    SHOAL_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, encoded_image(fs_, files_, document_, source));
    out_.source_bytes += bytes.size();
    SHOAL_ASSIGN_OR_RETURN(Image8 image, decode_image(bytes, source.name, max_pixels_));
    if (image.width == 0 || image.height == 0 || std::max(image.width, image.height) > kMaxTextureSide) {
      return Error{ErrorCode::kInput, fmt::format("expected 1 to {} texels a side, found {} x {}", kMaxTextureSide,
                                                  image.width, image.height)};
    }
    return image;
  }

  /// `users` are the requests that share this pyramid: they differ in their sampler only.
  Status tile_pyramid(Image8&& image, const std::vector<uint32_t>& users) {
    const bool srgb = requests_[users.front()].srgb, opaque = all_opaque(image);
    Texture texture;
    texture.width = image.width, texture.height = image.height;
    texture.level_count = full_level_count(image.width, image.height);
    texture.srgb = srgb;
    MipPyramid pyramid(std::move(image), srgb);
    TextureFacts facts;
    pyramid.mean(facts.mean);
    facts.opaque = opaque;
    do {
      const uint32_t l = pyramid.level_index();
      SHOAL_ASSIGN_OR_RETURN(texture.first_page[l], write_level(pyramid.level(), writer_, out_.pages_bytes));
      for (const uint32_t r : users) {
        if (requests_[r].needs_alpha && !opaque) coverage_.add_level(r, alpha_of(pyramid.level()));
      }
    } while (pyramid.next());
    for (const uint32_t r : users) {
      texture.wrap_u = requests_[r].wrap_u, texture.wrap_v = requests_[r].wrap_v;
      texture.nearest = requests_[r].nearest;
      out_.textures[r] = texture;
      out_.facts[r] = facts;
    }
    return {};
  }

  FileSystem& fs_;
  gltf::BufferFiles& files_;
  const gltf::Document& document_;
  const std::vector<TextureRequest>& requests_;
  uint64_t max_pixels_;
  PageFileWriter& writer_;
  CoverageTextures& coverage_;
  TiledTextures out_;
};

}  // namespace

Result<TiledTextures> tile_textures(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
                                    const std::vector<TextureRequest>& requests, const gltf::Limits& limits,
                                    PageFileWriter& writer, CoverageTextures& coverage,
                                    const std::function<void(double)>& progress) {
  TextureTiler tiler(fs, files, document, requests, limits.image_pixels, writer, coverage);
  std::vector<uint32_t> order(requests.size());
  for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return requests[a].image < requests[b].image; });
  for (size_t i = 0; i < order.size();) {
    size_t end = i;
    while (end < order.size() && requests[order[end]].image == requests[order[i]].image) ++end;
    SHOAL_RETURN_IF_ERROR(
        tiler.tile_image({order.begin() + static_cast<ptrdiff_t>(i), order.begin() + static_cast<ptrdiff_t>(end)}));
    i = end;
    progress(static_cast<double>(i) / static_cast<double>(order.size()));
  }
  return tiler.take();
}

}  // namespace shoal
