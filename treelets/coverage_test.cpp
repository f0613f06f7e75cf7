#include "treelets/coverage_test.h"

#include <cmath>

#include "treelets/coverage.h"

namespace shoal {
namespace {

/// A texel coordinate on one axis of the crop or, for a whole level, wrapped as glTF 2.0 (section 3.8.4.5) says.
uint32_t wrap_texel(int64_t i, int64_t size, WrapMode mode) {
  switch (mode) {
    case WrapMode::kClampToEdge:
      return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, size - 1));
    case WrapMode::kMirroredRepeat: {
      const int64_t period = 2 * size;
      const int64_t m = ((i % period) + period) % period;
      return static_cast<uint32_t>(m < size ? m : period - 1 - m);
    }
    case WrapMode::kRepeat:
      break;
  }
  return static_cast<uint32_t>(((i % size) + size) % size);
}

struct Axis {
  uint32_t texel[2];
  float weight;  ///< of the second texel
};

/// The two texels on either side of coordinate `x` (texel centres at +0.5), or the one that holds it.
Axis resolve(float x, int32_t crop_first, uint32_t size, WrapMode mode, bool whole_level, bool nearest) {
  // A float's integer part fits: check_treelet() bounds |x|.
  const double at = nearest ? static_cast<double>(x) : static_cast<double>(x) - 0.5;
  const double below = std::floor(at);
  const int64_t first = static_cast<int64_t>(below) - (whole_level ? 0 : crop_first);
  const WrapMode wrap = whole_level ? mode : WrapMode::kClampToEdge;
  return {{wrap_texel(first, size, wrap), wrap_texel(first + 1, size, wrap)}, static_cast<float>(at - below)};
}

float texture_alpha(const CoverageRecord& record, const uint8_t* texels, float u, float v) {
  const bool whole = record.whole_level != 0, nearest = record.nearest != 0;
  const Axis x = resolve(u, record.crop_x, record.crop_width, static_cast<WrapMode>(record.wrap_u), whole, nearest);
  const Axis y =
      resolve(v, record.crop_y, record.crop_height, static_cast<WrapMode>(record.wrap_v), whole, nearest);
  const auto texel = [&](int i, int j) {
    return static_cast<float>(texels[record.texel_offset + size_t{y.texel[j]} * record.crop_width + x.texel[i]]);
  };
  if (nearest) return texel(0, 0) / 255.0f;
  const float top = texel(0, 0) + (texel(1, 0) - texel(0, 0)) * x.weight;
  const float bottom = texel(0, 1) + (texel(1, 1) - texel(0, 1)) * x.weight;
  return (top + (bottom - top) * y.weight) / 255.0f;
}

}  // namespace

float coverage_threshold(uint32_t alpha_seed, uint32_t instance, uint32_t primitive) {
  uint32_t x = alpha_seed * 1664525u + 1013904223u;
  uint32_t y = instance * 1664525u + 1013904223u;
  uint32_t z = primitive * 1664525u + 1013904223u;
  x += y * z, y += z * x, z += x * y;
  x ^= x >> 16, y ^= y >> 16, z ^= z >> 16;
  x += y * z;
  return static_cast<float>(x >> 8) * 0x1p-24f;
}

float coverage_alpha(const CoverageRecord& record, const uint8_t* texels, float b1, float b2) {
  const float b0 = 1 - b1 - b2;
  const float* va = record.vertex_alpha;
  float alpha = record.factor * (b0 * va[0] + b1 * va[1] + b2 * va[2]);
  if (record.crop_width != 0) {
    const float* uv = record.uv;
    alpha *=
        texture_alpha(record, texels, b0 * uv[0] + b1 * uv[2] + b2 * uv[4], b0 * uv[1] + b1 * uv[3] + b2 * uv[5]);
  }
  return alpha;
}

bool is_covered(const CoverageRecord& record, const uint8_t* texels, const TriangleHit& hit, uint32_t alpha_seed,
                uint32_t instance, uint32_t primitive) {
  const CoverageMode mode = static_cast<CoverageMode>(record.mode);
  if (mode == CoverageMode::kOpaque) return true;
  const float alpha = coverage_alpha(record, texels, hit.b1, hit.b2);
  if (mode == CoverageMode::kMask) return alpha >= record.cutoff;
  return alpha > coverage_threshold(alpha_seed, instance, primitive);
}

}  // namespace shoal
