#include "engine/sample_order.h"

#include <bit>

namespace shoal {
namespace {

/// Finaliser of MurmurHash3 (Appleby): any mixing that never changes would do.
uint32_t mix(uint32_t value) {
  value = (value ^ (value >> 16)) * 0x85ebca6bu;
  value = (value ^ (value >> 13)) * 0xc2b2ae35u;
  return value ^ (value >> 16);
}

}  // namespace

SampleOrder::SampleOrder(uint32_t width, uint32_t height, SampleSpan span, uint32_t tile_sample,
                         uint32_t coarse_levels)
    : width_(width),
      height_(height),
      first_sample_(span.begin),
      samples_(span.count()),
      pixel_count_(uint64_t{width} * height) {
  if (tile_sample > 1) leave_out_tiles(tile_sample);
  if (coarse_levels > 0) add_lattices(coarse_levels);
}

SampleOrder::SampleOrder(uint32_t width, uint32_t height, SampleSpan span, std::span<const uint32_t> blocks)
    : width_(width),
      height_(height),
      first_sample_(span.begin),
      samples_(span.count()),
      tile_side_(kBlock),
      pixel_count_(0) {
  const uint32_t across = (width + kBlock - 1) / kBlock;
  tiles_.reserve(blocks.size());
  for (const uint32_t block : blocks) {
    const uint32_t x = block % across, y = block / across;
    tiles_.push_back({pixel_count_, pixels_before(x, y)});
    pixel_count_ += pixels_in(x, y);
  }
}

std::vector<uint32_t> SampleOrder::blocks_in_order(uint32_t width, uint32_t height) {
  constexpr uint32_t kBlocks = kTile / kBlock;
  const uint32_t across = (width + kBlock - 1) / kBlock, down = (height + kBlock - 1) / kBlock;
  std::vector<uint32_t> blocks;
  blocks.reserve(size_t{across} * down);
  for (uint32_t tile_y = 0; tile_y < down; tile_y += kBlocks) {
    for (uint32_t tile_x = 0; tile_x < across; tile_x += kBlocks) {
      for (uint32_t y = tile_y; y < std::min(tile_y + kBlocks, down); ++y) {
        for (uint32_t x = tile_x; x < std::min(tile_x + kBlocks, across); ++x) blocks.push_back(y * across + x);
      }
    }
  }
  return blocks;
}

void SampleOrder::leave_out_tiles(uint32_t tile_sample) {
  const uint32_t across = (width_ + kTile - 1) / kTile;
  const uint32_t tiles = across * ((height_ + kTile - 1) / kTile);
  pixel_count_ = 0;
  for (uint32_t first = 0, group = 0; first < tiles; ++group) {
    const uint32_t size = std::min(tile_sample, tiles - first);
    // The last group may be smaller: it gives a tile as often as its size says, but a picture has at least one.
    const uint32_t choice = mix(group) % (group == 0 ? size : tile_sample);
    if (choice < size) {
      const uint32_t x = (first + choice) % across, y = (first + choice) / across;
      tiles_.push_back({pixel_count_, pixels_before(x, y)});
      pixel_count_ += pixels_in(x, y);
    }
    first += size;
  }
}

void SampleOrder::add_lattices(uint32_t levels) {
  const uint32_t width = tiles_.empty() ? width_ : static_cast<uint32_t>(pixel_count_);
  const uint32_t height = tiles_.empty() ? height_ : 1;
  const auto pixels = [&](uint64_t spacing) {
    return ((width + spacing - 1) / spacing) * ((height + spacing - 1) / spacing);
  };
  uint32_t spacing = 1;
  while (spacing < kWidestSpacing && pixels(2 * spacing) >= kFirstLatticePixels) spacing *= 2;
  add_lattice(0, 0, spacing, width, height);
  first_lattice_count_ = lattices_count_;
  for (; spacing > 1 && levels > 1; spacing /= 2, --levels) {
    add_lattice(spacing / 2, 0, spacing, width, height);
    add_lattice(0, spacing / 2, spacing, width, height);
    add_lattice(spacing / 2, spacing / 2, spacing, width, height);
  }
  finest_spacing_ = spacing;
}

void SampleOrder::add_lattice(uint32_t x, uint32_t y, uint32_t spacing, uint32_t width, uint32_t height) {
  Lattice lattice{lattices_count_, x, y, spacing, 0, 0};
  if (x < width) lattice.across = (width - x + spacing - 1) / spacing;
  if (y < height) lattice.down = (height - y + spacing - 1) / spacing;
  lattices_count_ += uint64_t{lattice.across} * lattice.down;
  lattices_.push_back(lattice);
}

PixelSample SampleOrder::coarse_first(uint64_t index) const {
  if (index < lattices_count_) return at_lattice(index);
  // The lattices took the place of the first samples in the order of tiles. Following a sample that is done to the one
  // whose place it took, and that to the next if it is done as well, ends at another sample for every start.
  for (;;) {
    const uint64_t pixel = index / samples_, sample = index % samples_;
    const uint64_t taken = sample == 0 ? lattice_index(pixel) : kNone;
    if (taken == kNone) return at_pixel(pixel, static_cast<uint32_t>(sample));
    index = taken;
  }
}

PixelSample SampleOrder::at_lattice(uint64_t index) const {
  const auto lattice = std::upper_bound(lattices_.begin(), lattices_.end(), index,
                                        [](uint64_t value, const Lattice& l) { return value < l.first; }) - 1;
  const Place place = in_tiles(index - lattice->first, lattice->across, lattice->down, kTile);
  const uint32_t x = lattice->x + place.x * lattice->spacing, y = lattice->y + place.y * lattice->spacing;
  return tiles_.empty() ? PixelSample{x, y, first_sample_} : at_pixel(x, 0);
}

uint64_t SampleOrder::lattice_index(uint64_t pixel) const {
  const Place p = tiles_.empty() ? in_tiles(pixel, width_, height_, kTile) : Place{static_cast<uint32_t>(pixel), 0};
  if (((p.x | p.y) & (finest_spacing_ - 1)) != 0) return kNone;
  size_t number = 0;
  if (((p.x | p.y) & (lattices_[0].spacing - 1)) != 0) {
    const int step = std::countr_zero(p.x | p.y);  // half the spacing of its lattice is 2^step
    const uint32_t odd_x = p.x >> step & 1, odd_y = p.y >> step & 1;
    number = 3 * (std::countr_zero(lattices_[0].spacing) - step) - 3 + odd_x + 2 * odd_y;
  }
  const Lattice& lattice = lattices_[number];
  const uint32_t x = (p.x - lattice.x) / lattice.spacing, y = (p.y - lattice.y) / lattice.spacing;
  const uint64_t tile_width = std::min(kTile, lattice.across - x / kTile * kTile);
  const uint64_t tile_height = std::min(kTile, lattice.down - y / kTile * kTile);
  return lattice.first + uint64_t{y / kTile * kTile} * lattice.across + x / kTile * kTile * tile_height +
         y % kTile * tile_width + x % kTile;
}

}  // namespace shoal
