#include "engine/sampler.h"

#include <algorithm>
#include <array>
#include <bit>

#include "engine/sobol.h"

namespace shoal {
namespace {

/// Where a sample's number would stand, what hashes to a key has one from here on: no sample has such a number.
constexpr uint32_t kKeys = 0x80000000u;

/// Finaliser of MurmurHash3 (Appleby).
uint32_t mixed(uint32_t value) {
  value = (value ^ (value >> 16)) * 0x85ebca6bu;
  value = (value ^ (value >> 13)) * 0xc2b2ae35u;
  return value ^ (value >> 16);
}

/// Of 64 bits (Stafford 2011, "Better Bit Mixing", variant 13); 0 stays 0.
uint64_t mixed_seed(uint64_t seed) {
  seed = (seed ^ (seed >> 30)) * 0xbf58476d1ce4e5b9u;
  seed = (seed ^ (seed >> 27)) * 0x94d049bb133111ebu;
  return seed ^ (seed >> 31);
}

/// The point with this index of the sequence that `key` scrambles (its words 1 to 3).
Random4 sobol_point(uint32_t index, const Random4& key, Dimension dimension) {
  const uint32_t a = reversed_bits(owen_scrambled(sobol0_reversed(index), key.bits[1]));
  const bool one = dimension != Dimension::kPixel && dimension != Dimension::kLens &&
                   dimension != Dimension::kLight && dimension != Dimension::kBsdf;
  if (one) return {{a, key.bits[1], key.bits[2], key.bits[3]}};
  const uint32_t b = reversed_bits(owen_scrambled(sobol1_reversed(index), key.bits[2]));
  if (dimension == Dimension::kPixel || dimension == Dimension::kLens) return {{a, b, key.bits[2], key.bits[3]}};
  const uint32_t c = reversed_bits(owen_scrambled(sobol2_reversed(index), key.bits[3]));
  return {{c, a, b, mixed(index ^ key.bits[3])}};  // the last: digits of the choice beyond the 32 of the sequence
}

/// The 24 orders of four quadrants, two bits each.
constexpr std::array<uint8_t, 24> kQuadrantOrders = [] {
  std::array<uint8_t, 24> orders{};
  size_t count = 0;
  for (uint32_t code = 0; code < 256; ++code) {
    const uint32_t seen = 1u << (code & 3) | 1u << (code >> 2 & 3) | 1u << (code >> 4 & 3) | 1u << (code >> 6);
    if (seen == 15) orders[count++] = static_cast<uint8_t>(code);
  }
  return orders;
}();

/// Where a pixel comes when at every level, from the whole tile down, the quadrants have an order drawn for them.
uint32_t pixel_order(uint32_t morton, uint32_t levels, uint32_t key) {
  uint32_t order = 0;
  for (uint32_t level = 0; level < levels; ++level) {
    const uint32_t shift = 2 * (levels - 1 - level);
    // What lies above, with a bit before it, so that the paths of two levels differ.
    const uint32_t above = static_cast<uint32_t>((uint64_t{1} << 2 * level) | (uint64_t{morton} >> (shift + 2)));
    const uint32_t drawn = static_cast<uint32_t>(uint64_t{mixed(above ^ key)} * kQuadrantOrders.size() >> 32);
    order = order << 2 | (kQuadrantOrders[drawn] >> 2 * (morton >> shift & 3) & 3);
  }
  return order;
}

/// The lower 16 bits, one place apart.
uint32_t spread_bits(uint32_t x) {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}

uint32_t bits_for(uint32_t count) { return static_cast<uint32_t>(std::bit_width(std::max(count, 1u) - 1)); }

}  // namespace

uint32_t Sampler::bits_of(uint32_t samples, SampleSets sets) {
  return bits_for(sets == SampleSets::kHalves ? (samples + 1) / 2 : samples);
}

Sampler::Sampler(SamplerKind kind, uint64_t seed, uint32_t width, uint32_t height, uint32_t samples, SampleSets sets)
    : kind_(kind),
      seed_(mixed_seed(seed)),
      width_(std::max(width, 1u)),
      half_bits_(sets == SampleSets::kHalves ? 1 : 0) {
  if (kind != SamplerKind::kBlueNoise) return;
  sample_bits_ = bits_of(samples, sets);
  tile_levels_ = std::min(bits_for(std::max(width, height)), (31 - sample_bits_) / 2);  // an index has 32 bits
}

Random4 Sampler::draw_sobol(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const {
  const Random4 key = random4(seed_, pixel, kKeys | (sample & half_bits_), bounce, dimension);
  return sobol_point(shuffled_index(sample >> half_bits_, key.bits[0]), key, dimension);
}

Random4 Sampler::draw_blue_noise(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const {
  const uint32_t y = pixel / width_, x = pixel - y * width_;
  const uint32_t tile_mask = (1u << tile_levels_) - 1, sample_mask = (1u << sample_bits_) - 1;
  // Tiles, and samples beyond those that were announced, have sequences of their own.
  const uint32_t tile = (y >> tile_levels_) << 16 | x >> tile_levels_;
  const uint32_t number = sample >> half_bits_, half = sample & half_bits_;
  const Random4 key = random4(seed_, tile, kKeys | (number >> sample_bits_) << 1 | half, bounce, dimension);
  const uint32_t morton = spread_bits(y & tile_mask) << 1 | spread_bits(x & tile_mask);
  const uint32_t order = pixel_order(morton, tile_levels_, key.bits[0]);
  const uint32_t in_pixel = shuffled_index(number & sample_mask, mixed(order ^ key.bits[0])) & sample_mask;
  return sobol_point(order << sample_bits_ | in_pixel, key, dimension);
}

}  // namespace shoal
