// Directional albedo of the GGX lobe, split for Schlick's Fresnel term: with F = F0 + (F90 - F0)(1 - h.wo)^5 the
// lobe reflects F0 * a + F90 * b. Tabulated by deterministic quadrature over visible normals when a scene has a
// material with a specular lobe. Called by engine/bsdf. Immutable; a look-up is four square roots and a bilinear
// interpolation.
#pragma once

#include <cstdint>
#include <vector>

namespace shoal {

struct SpecularAlbedo {
  float a = 0, b = 0;
  float total() const { return a + b; }  ///< F0 = F90 = 1
};

/// The integral itself with `steps` x `steps` points, in double; the table holds it, tests refine it.
SpecularAlbedo integrate_specular_albedo(float mu, float alpha, int steps);

class EnergyTable {
 public:
  explicit EnergyTable(unsigned threads = 1);  ///< fills the table
  /// Requires: 0 < mu <= 1, kMinAlpha <= alpha <= 1. Error below 0.3 % of 1 (tested).
  SpecularAlbedo albedo(float mu, float alpha) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(SpecularAlbedo); }

 private:
  std::vector<SpecularAlbedo> cells_;  ///< [alpha][mu]
};

}  // namespace shoal
