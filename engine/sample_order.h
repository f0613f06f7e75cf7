// The order in which samples of the picture are begun: tiles of 32 x 32 pixels row by row, in a tile all samples of
// a pixel after one another, so that the paths in flight are close together. The picture does not depend on it.
#pragma once

#include <algorithm>
#include <cstdint>

namespace shoal {

struct PixelSample {
  uint32_t x, y, sample;
};

class SampleOrder {
 public:
  SampleOrder(uint32_t width, uint32_t height, uint32_t samples)
      : width_(width), height_(height), samples_(samples) {}

  uint64_t count() const { return uint64_t{width_} * height_ * samples_; }

  /// Requires: index < count().
  PixelSample at(uint64_t index) const {
    const uint64_t row_samples = uint64_t{width_} * kTile * samples_;  // of a full row of tiles
    const uint32_t tile_y = static_cast<uint32_t>(index / row_samples);
    const uint32_t tile_height = std::min(kTile, height_ - tile_y * kTile);
    uint64_t rest = index - tile_y * row_samples;
    const uint64_t tile_samples = uint64_t{kTile} * tile_height * samples_;
    const uint32_t tile_x = static_cast<uint32_t>(rest / tile_samples);
    const uint32_t tile_width = std::min(kTile, width_ - tile_x * kTile);
    rest -= tile_x * tile_samples;
    const uint64_t pixel = rest / samples_;
    return {tile_x * kTile + static_cast<uint32_t>(pixel % tile_width),
            tile_y * kTile + static_cast<uint32_t>(pixel / tile_width), static_cast<uint32_t>(rest % samples_)};
  }

 private:
  static constexpr uint32_t kTile = 32;
  uint32_t width_, height_, samples_;
};

}  // namespace shoal
