#include "engine/sample_order.h"

namespace shoal {
namespace {

/// Finaliser of MurmurHash3 (Appleby): any mixing that never changes would do.
uint32_t mix(uint32_t value) {
  value = (value ^ (value >> 16)) * 0x85ebca6bu;
  value = (value ^ (value >> 13)) * 0xc2b2ae35u;
  return value ^ (value >> 16);
}

}  // namespace

SampleOrder::SampleOrder(uint32_t width, uint32_t height, uint32_t samples, uint32_t tile_sample)
    : width_(width), height_(height), samples_(samples), pixel_count_(uint64_t{width} * height) {
  if (tile_sample == 1) return;
  const uint32_t across = (width + kTile - 1) / kTile;
  const uint32_t tiles = across * ((height + kTile - 1) / kTile);
  pixel_count_ = 0;
  for (uint32_t first = 0, group = 0; first < tiles; ++group) {
    const uint32_t size = std::min(tile_sample, tiles - first);
    // The last group may be smaller: it gives a tile as often as its size says, but a picture has at least one.
    const uint32_t choice = mix(group) % (group == 0 ? size : tile_sample);
    if (choice < size) {
      const uint32_t x = (first + choice) % across * kTile, y = (first + choice) / across * kTile;
      const uint64_t tile_height = std::min(kTile, height - y);
      tiles_.push_back({pixel_count_, uint64_t{width} * y + x * tile_height});
      pixel_count_ += std::min(kTile, width - x) * tile_height;
    }
    first += size;
  }
}

}  // namespace shoal
