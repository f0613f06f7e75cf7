// FLIP: how different two pictures look to someone who flips between them, 0 (alike) to 1 a pixel.
// LDR: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild 2020, "FLIP: A Difference Evaluator for
// Alternating Images", HPG 2020; the constants are those of its section 4 and of the authors' program. HDR: Andersson,
// Nilsson, Shirley, Akenine-Moller 2021, "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics 2021.
// Equations as used here:
//   colour    pictures in YCxCz are blurred by the eye's contrast sensitivity (sums of Gaussians a sqrt(pi / b)
//             exp(-pi^2 x^2 / b), table 1), taken to L*a*b* with a* and b* times 0.01 L* (Hunt), and compared by
//             HyAB = |dL*| + sqrt(da*^2 + db*^2) to the power 0.7, mapped to [0, 1] so that 0.4 of the largest
//             becomes 0.95;
//   feature   edges and points of the luminance, by first and second derivatives of a Gaussian 0.082 degrees wide:
//             (max(|d edge|, |d point|) / sqrt(2))^0.5;
//   FLIP      colour^(1 - feature).
// Called by `shoal diff`, engine/accuracy and tests. Plain values, any thread. Cost: about 0.3 us a pixel and picture, and
// 60 bytes a pixel while it works.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace shoal {

/// 0.7 m before a screen 0.7 m wide with 3840 pixels, as in the paper.
inline constexpr float kFlipPixelsPerDegree = 67.0206f;

/// One picture seen by the model; others are compared with it.
class FlipReference {
 public:
  /// `rgb`: linear display colours, three a pixel, rows from the top; clamped to [0, 1].
  /// Requires: 3 * width * height values.
  FlipReference(uint32_t width, uint32_t height, std::span<const float> rgb,
                float pixels_per_degree = kFlipPixelsPerDegree);
  /// A value a pixel. The same when reference and test change places. Requires: `rgb` of the same size.
  std::vector<float> compare(std::span<const float> rgb) const;

  static uint64_t bytes(uint64_t pixels) { return pixels * 5 * sizeof(float); }

 private:
  /// What the eye makes of a picture.
  struct Seen {
    std::vector<float> lab;     ///< three a pixel, adjusted by Hunt
    std::vector<float> edges, points;
  };
  Seen see(std::span<const float> rgb) const;

  uint32_t width_, height_;
  float pixels_per_degree_;
  Seen reference_;
};

/// HDR-FLIP: the largest LDR-FLIP over the exposures at which the reference can be looked at, through the ACES tone curve.
/// Linear radiance, three values a pixel. Not symmetric: the exposures are those of the reference.
std::vector<float> hdr_flip(uint32_t width, uint32_t height, std::span<const float> reference,
                            std::span<const float> test);

double mean_value(std::span<const float> map);

}  // namespace shoal
