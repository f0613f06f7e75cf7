// Coverage: how much of a surface is there, for alpha MASK and BLEND. A treelet knows coverage, not
// materials: for each triangle of a covered material its page holds a crop of the alpha channel around the triangle's uv
// range, so that traversal decides a hit without any other page.
//
// The crop of a triangle depends on the triangle and the texture only, never on the treelet, so that
// cutting differently cannot change the picture. It is taken from the finest mip level at which it has at most
// kMaxCropTexels texels a side, in unwrapped texel space or, if that is finer, as the whole wrapped level.
#pragma once

#include <cstdint>
#include <span>

#include "io/result.h"
#include "treelets/vector.h"

namespace shoal {

inline constexpr uint32_t kMaxCropTexels = 256;

enum class CoverageMode : uint8_t { kOpaque, kMask, kBlend };
enum class WrapMode : uint8_t { kRepeat, kMirroredRepeat, kClampToEdge };

/// The coverage of one material. alpha = factor * vertex alpha * texture alpha; kMask: there when
/// alpha >= cutoff; kBlend: there when alpha > hash(ray.alpha_seed, instance, primitive) in [0,1).
struct MaterialCoverage {
  CoverageMode mode = CoverageMode::kOpaque;
  float factor = 1;
  float cutoff = 0.5f;
  uint32_t texture = 0xffffffffu;  ///< kNoIndex: none
  uint32_t uv_set = 0;
  bool transformed = false;        ///< the uv are moved first: u' = m[0] u + m[1] v + m[2], v' = m[3] u + m[4] v + m[5]
  float uv_transform[6] = {1, 0, 0, 0, 1, 0};
  WrapMode wrap_u = WrapMode::kRepeat, wrap_v = WrapMode::kRepeat;
  bool nearest = false;            ///< the sampler magnifies without interpolation
};

/// Where the builder finds coverage: implemented by engine over materials and texture pyramids.
class CoverageSource {
 public:
  virtual ~CoverageSource() = default;
  virtual MaterialCoverage coverage(uint32_t material) const = 0;
  /// Number of mip levels and the size of one.
  virtual uint32_t level_count(uint32_t texture) const = 0;
  virtual void level_size(uint32_t texture, uint32_t level, uint32_t* width, uint32_t* height) const = 0;
  /// Alpha of row y, texels [x, x + out.size()), inside the level, as 8-bit values. Thread-safe.
  virtual Status read_alpha(uint32_t texture, uint32_t level, uint32_t x, uint32_t y,
                            std::span<uint8_t> out) const = 0;
};

}  // namespace shoal
