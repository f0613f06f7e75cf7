#include "engine/film.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <mutex>

#include "io/result.h"

namespace shoal {

FixedPoint128 FixedPoint128::from_float(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const int exponent = static_cast<int>((bits >> 23) & 0xff);
  if (exponent == 0) return {};  // zero and denormals: below 2^-126
  const unsigned __int128 mantissa = (bits & 0x7fffffu) | 0x800000u;
  const int shift = exponent - 127 - 23 + 64;  // the value is mantissa * 2^(shift - 64)
  unsigned __int128 magnitude = 0;
  if (shift >= 0) {
    magnitude = mantissa << shift;
  } else if (shift > -24) {
    magnitude = mantissa >> -shift;
  }
  const __int128 fixed = (bits >> 31) != 0 ? -static_cast<__int128>(magnitude) : static_cast<__int128>(magnitude);
  return {static_cast<int64_t>(fixed >> 64), static_cast<uint64_t>(fixed)};
}

double FixedPoint128::to_double() const {
  // A small negative number is -1 and nearly 1: its digits would be lost.
  const FixedPoint128 positive{-high - (low != 0 ? 1 : 0), 0 - low};
  if (high < 0) return -positive.to_double();
  return static_cast<double>(high) + static_cast<double>(low) * 0x1p-64;
}

Film::Film(uint32_t width, uint32_t height, uint32_t halves)
    : width_(width),
      height_(height),
      halves_(halves),
      pixels_(size_t{width} * height * halves),
      locks_(std::make_unique<SpinLock[]>(kLocks)) {}

bool Film::add(uint32_t pixel, const Vec3& radiance, bool covered, uint32_t half) {
  FixedPoint128 fixed[3];
  bool inside = true;
  for (int c = 0; c < 3; ++c) {
    const float value = std::clamp(radiance[c], -kMaxRadiance, kMaxRadiance);
    inside = inside && value == radiance[c];
    fixed[c] = FixedPoint128::from_float(value);
  }
  Pixel& p = pixels_[half == 0 ? pixel : second(pixel)];
  std::lock_guard guard(locks_[pixel % kLocks]);
  for (int c = 0; c < 3; ++c) p.rgb[c].add(fixed[c]);
  p.covered += covered ? 1 : 0;
  ++p.added;
  return inside;
}

bool Film::plausible(uint32_t samples) const {
  return std::all_of(pixels_.begin(), pixels_.end(), [&](const Pixel& pixel) {
    const bool in_range = pixel.rgb[0].in_range() && pixel.rgb[1].in_range() && pixel.rgb[2].in_range();
    return in_range && pixel.covered <= pixel.added && pixel.added <= samples;
  });
}

void Film::add_raw(uint64_t first_byte, std::span<const std::byte> bytes) {
  static_assert(sizeof(Pixel) == kPixelBytes);
  SHOAL_CHECK(first_byte % sizeof(Pixel) == 0 && bytes.size() % sizeof(Pixel) == 0);
  Pixel* to = pixels_.data() + first_byte / sizeof(Pixel);
  for (size_t at = 0; at < bytes.size(); at += sizeof(Pixel), ++to) {
    Pixel from;
    std::memcpy(&from, &bytes[at], sizeof(Pixel));
    for (int c = 0; c < 3; ++c) to->rgb[c].add(from.rgb[c]);
    to->covered += from.covered;
    to->added += from.added;
  }
}

Film::Mean Film::mean_of(const Pixel& pixel) {
  const double scale = pixel.added > 0 ? 1.0 / pixel.added : 0.0;
  Mean mean;
  for (int c = 0; c < 3; ++c) mean.rgba[c] = pixel.rgb[c].to_double() * scale;
  mean.rgba[3] = pixel.covered * scale;
  return mean;
}

Film::Mean Film::mean_of(const Pixel& a, const Pixel& b) {
  if (b.added == 0) return mean_of(a);
  if (a.added == 0) return mean_of(b);
  Mean mean = mean_of(a);
  const Mean other = mean_of(b);
  for (int c = 0; c < 4; ++c) mean.rgba[c] = 0.5 * (mean.rgba[c] + other.rgba[c]);
  return mean;
}

uint32_t Film::mean(uint32_t pixel, float rgb[3]) const {
  Pixel a, b;
  {
    std::lock_guard guard(locks_[pixel % kLocks]);
    a = pixels_[pixel];
    if (halves_ == 2) b = pixels_[second(pixel)];
  }
  const Mean mean = mean_of(a, b);
  for (int c = 0; c < 3; ++c) rgb[c] = static_cast<float>(mean.rgba[c]);
  return a.added + b.added;
}

std::vector<float> Film::resolve() const {
  const size_t pixels = size_t{width_} * height_;
  std::vector<float> rgba(pixels * 4);
  for (size_t i = 0; i < pixels; ++i) {
    const Mean mean = halves_ == 2 ? mean_of(pixels_[i], pixels_[second(i)]) : mean_of(pixels_[i]);
    for (size_t c = 0; c < 4; ++c) rgba[i * 4 + c] = static_cast<float>(mean.rgba[c]);
  }
  return rgba;
}

}  // namespace shoal
