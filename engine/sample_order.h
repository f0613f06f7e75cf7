// The order in which samples of the picture are begun: tiles of 32 x 32 pixels row by row, in a tile all samples of
// a pixel after one another, so that the paths in flight are close together. The picture does not depend on it.
//
// With `tile_sample` N only one in N tiles is rendered: of every N tiles in that order the one that a fixed hash names,
// so that they are spread over the picture and the same in every order. Called by engine/render_*. Immutable, any
// number of threads. Cost: a few divisions, and a binary search among the tiles when some are left out.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace shoal {

struct PixelSample {
  uint32_t x, y, sample;
};

class SampleOrder {
 public:
  /// Requires: tile_sample > 0.
  SampleOrder(uint32_t width, uint32_t height, uint32_t samples, uint32_t tile_sample = 1);

  uint64_t count() const { return pixel_count_ * samples_; }
  /// Pixels that are rendered.
  uint64_t pixel_count() const { return pixel_count_; }

  /// Requires: index < count().
  PixelSample at(uint64_t index) const {
    const uint64_t pixel = index / samples_;
    const uint32_t sample = static_cast<uint32_t>(index % samples_);
    if (tiles_.empty()) return at_pixel(pixel, sample);
    const auto tile = std::upper_bound(tiles_.begin(), tiles_.end(), pixel,
                                       [](uint64_t value, const Tile& t) { return value < t.first; }) - 1;
    return at_pixel(tile->pixel + (pixel - tile->first), sample);
  }

 private:
  static constexpr uint32_t kTile = 32;
  struct Tile {
    uint64_t first;  ///< its first pixel among those that are rendered
    uint64_t pixel;  ///< ... and among all
  };

  /// `pixel` counts all pixels of the picture, tile by tile.
  PixelSample at_pixel(uint64_t pixel, uint32_t sample) const {
    const uint64_t row_pixels = uint64_t{width_} * kTile;  // of a full row of tiles
    const uint32_t tile_y = static_cast<uint32_t>(pixel / row_pixels);
    const uint32_t tile_height = std::min(kTile, height_ - tile_y * kTile);
    uint64_t rest = pixel - tile_y * row_pixels;
    const uint64_t tile_pixels = uint64_t{kTile} * tile_height;
    const uint32_t tile_x = static_cast<uint32_t>(rest / tile_pixels);
    const uint32_t tile_width = std::min(kTile, width_ - tile_x * kTile);
    rest -= tile_x * tile_pixels;
    return {tile_x * kTile + static_cast<uint32_t>(rest % tile_width),
            tile_y * kTile + static_cast<uint32_t>(rest / tile_width), sample};
  }

  uint32_t width_, height_, samples_;
  uint64_t pixel_count_;
  std::vector<Tile> tiles_;  ///< empty: all
};

}  // namespace shoal
