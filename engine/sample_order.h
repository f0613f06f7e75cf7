// The order in which samples of the picture are begun: tiles of 32 x 32 pixels row by row, in a tile all samples of
// a pixel after one another, so that the paths in flight are close together. The picture does not depend on it.
//
// Coarse first (for a preview): before all others come the first samples of a sparse lattice of pixels, then of the
// lattices between, each half as wide as the one before (as in interlaced PNG), as many as were asked for. Indices
// below the lattices' count name lattice samples. Every later index names its sample in tile order; if a lattice took
// that one, it names instead the sample displaced at that lattice index (repeated until free), so each sample occurs
// once.
//
// Or of chosen blocks of 8 x 8 pixels only (engine/adaptive_sampling.h), in the order that is given.
//
// Of every pixel the samples [begin, end) of a span: what a render takes in one pass (engine/pass_plan.h).
//
// With `tile_sample` N only one in N tiles is rendered: of every N tiles in that order the one that a fixed hash names,
// so that they are spread over the picture and the same in every order. Called by engine/render_*. Immutable, any
// number of threads. Cost: a few divisions, a binary search among the tiles when some are left out, and one among the
// lattices.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace shoal {

struct PixelSample {
  uint32_t x, y, sample;
};

/// Samples of a pixel, by number; `end` is not among them.
struct SampleSpan {
  uint32_t begin = 0, end = 0;
  uint32_t count() const { return end - begin; }
};

class SampleOrder {
 public:
  /// Requires: tile_sample > 0.
  /// `coarse_levels`: how often the picture is gone over with a sample in few pixels, before the rest; 0: never.
  SampleOrder(uint32_t width, uint32_t height, SampleSpan span, uint32_t tile_sample = 1, uint32_t coarse_levels = 0);
  /// The samples [0, samples).
  SampleOrder(uint32_t width, uint32_t height, uint32_t samples, uint32_t tile_sample = 1, uint32_t coarse_levels = 0)
      : SampleOrder(width, height, SampleSpan{0, samples}, tile_sample, coarse_levels) {}
  /// Of the pixels of `blocks` only, one block after the other. A block is named by its place, row by row.
  SampleOrder(uint32_t width, uint32_t height, SampleSpan span, std::span<const uint32_t> blocks);
  static constexpr uint32_t kBlock = 8;
  /// All blocks, tile by tile.
  static std::vector<uint32_t> blocks_in_order(uint32_t width, uint32_t height);
  /// What an order of so many blocks holds.
  static uint64_t bytes_of_blocks(uint64_t blocks) { return blocks * sizeof(Tile); }
  static constexpr uint32_t kAllLevels = 32;  ///< until every pixel has a sample

  uint64_t count() const { return pixel_count_ * samples_; }
  /// Pixels that are rendered.
  uint64_t pixel_count() const { return pixel_count_; }
  /// Coarse first: samples of the first lattice, which are those with the lowest indices. Else 0.
  uint64_t first_lattice_count() const { return first_lattice_count_; }
  /// Coarse first: between the pixels of the first lattice, in x and y; a power of two. 1 when tiles are left out: what
  /// is first is not a lattice of the picture then.
  uint32_t first_spacing() const { return tiles_.empty() && !lattices_.empty() ? lattices_[0].spacing : 1; }

  /// Requires: index < count().
  PixelSample at(uint64_t index) const {
    return lattices_.empty() ? at_pixel(index / samples_, static_cast<uint32_t>(index % samples_)) : coarse_first(index);
  }

 private:
  static constexpr uint32_t kTile = 32;
  /// Pixels of the first lattice: enough to see what the picture shows. Twice as wide it would have fewer.
  static constexpr uint64_t kFirstLatticePixels = 1024;
  static constexpr uint32_t kWidestSpacing = 256;
  struct Tile {
    uint64_t first;  ///< its first pixel among those that are rendered
    uint64_t pixel;  ///< ... and among all
  };
  struct Lattice {
    uint64_t first;          ///< index of its first sample
    uint32_t x, y, spacing;  ///< its first pixel, and how far apart they are
    uint32_t across, down;   ///< pixels; none where the picture is too small
  };
  struct Place {
    uint32_t x, y;
  };

  void leave_out_tiles(uint32_t tile_sample);
  void add_lattices(uint32_t levels);
  void add_lattice(uint32_t x, uint32_t y, uint32_t spacing, uint32_t width, uint32_t height);
  PixelSample coarse_first(uint64_t index) const;
  PixelSample at_lattice(uint64_t index) const;
  /// Index of the pixel's sample 0 when that is in a lattice, else kNone.
  uint64_t lattice_index(uint64_t pixel) const;
  static constexpr uint64_t kNone = ~0ull;

  /// The `pixel`-th of a picture, tile by tile of so many pixels in x and y.
  static Place in_tiles(uint64_t pixel, uint32_t width, uint32_t height, uint32_t side) {
    const uint64_t row_pixels = uint64_t{width} * side;  // of a full row of tiles
    const uint32_t tile_y = static_cast<uint32_t>(pixel / row_pixels);
    const uint32_t tile_height = std::min(side, height - tile_y * side);
    uint64_t rest = pixel - tile_y * row_pixels;
    const uint64_t tile_pixels = uint64_t{side} * tile_height;
    const uint32_t tile_x = static_cast<uint32_t>(rest / tile_pixels);
    const uint32_t tile_width = std::min(side, width - tile_x * side);
    rest -= tile_x * tile_pixels;
    return {tile_x * side + static_cast<uint32_t>(rest % tile_width),
            tile_y * side + static_cast<uint32_t>(rest / tile_width)};
  }
  /// The pixels before tile (x, y), which starts inside the picture.
  uint64_t pixels_before(uint32_t tile_x, uint32_t tile_y) const {
    const uint32_t x = tile_x * tile_side_, y = tile_y * tile_side_;
    return uint64_t{width_} * y + uint64_t{x} * std::min(tile_side_, height_ - y);
  }
  uint64_t pixels_in(uint32_t tile_x, uint32_t tile_y) const {
    const uint32_t x = tile_x * tile_side_, y = tile_y * tile_side_;
    return uint64_t{std::min(tile_side_, width_ - x)} * std::min(tile_side_, height_ - y);
  }

  /// `pixel` counts those that are rendered, `sample` those of the span.
  PixelSample at_pixel(uint64_t pixel, uint32_t sample) const {
    if (!tiles_.empty()) {
      const auto tile = std::upper_bound(tiles_.begin(), tiles_.end(), pixel,
                                         [](uint64_t value, const Tile& t) { return value < t.first; }) - 1;
      pixel = tile->pixel + (pixel - tile->first);
    }
    const Place place = in_tiles(pixel, width_, height_, tile_side_);
    return {place.x, place.y, first_sample_ + sample};
  }

  uint32_t width_, height_, first_sample_, samples_;
  uint32_t tile_side_ = kTile;
  uint64_t pixel_count_;
  uint64_t first_lattice_count_ = 0, lattices_count_ = 0;  ///< samples
  uint32_t finest_spacing_ = 1;                            ///< of all lattices together
  std::vector<Tile> tiles_;        ///< empty: all. Of blocks in an order of such
  std::vector<Lattice> lattices_;  ///< empty: not coarse first. Of the picture, or of the row of pixels of all tiles_
};

}  // namespace shoal
