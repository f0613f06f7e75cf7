// The coverage of one triangle: which record its page needs, and which texels. Decided from the triangle and the
// texture alone (see coverage.h), so that the same triangle has the same coverage in every treelet.
// Called by treelets/cut_treelets (sizes) and treelets/pack_treelet. Immutable, any number of threads.
// Cost: about 100 ns a covered triangle; nothing is read before read_crop.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "io/result.h"
#include "treelets/coverage.h"
#include "treelets/treelet_layout.h"
#include "treelets/triangle_soup.h"

namespace shoal {

/// Names the texels of a crop: equal keys have equal texels, and share them within a page.
struct CropKey {
  uint32_t texture = kNoIndex, level = 0;
  int32_t x = 0, y = 0;
  uint32_t width = 0, height = 0;
  WrapMode wrap_u = WrapMode::kRepeat, wrap_v = WrapMode::kRepeat;

  bool operator==(const CropKey&) const = default;
  uint64_t texel_bytes() const { return uint64_t{width} * height; }
};

struct CoveragePlan {
  CoverageRecord record{};  ///< all but texel_offset
  CropKey crop;             ///< width 0: no texels
};

class CoverageCropper {
 public:
  /// `source` may be null: everything is opaque. Both outlive this object.
  CoverageCropper(const TriangleSoup& soup, const CoverageSource* source);

  /// False when no material of the soup is covered.
  bool any() const { return !materials_.empty(); }
  /// Nothing when the triangle is opaque.
  std::optional<CoveragePlan> plan(uint32_t triangle) const;
  /// Fills `out` (crop.texel_bytes()) row by row, wrapped. Fails with: what the source returns.
  Status read_crop(const CropKey& crop, std::span<uint8_t> out) const;

 private:
  const TriangleSoup& soup_;
  const CoverageSource* source_;
  std::unordered_map<uint32_t, MaterialCoverage> materials_;  // the covered ones; looked up, never iterated
};

/// The crops of one page as they gather: each key once.
class CropSet {
 public:
  /// Texel offset of `key`, which is added when it is new.
  uint32_t add(const CropKey& key);
  void clear() { truncate(0); }
  /// Forgets all keys but the first `count`.
  void truncate(size_t count);
  uint64_t texel_bytes() const { return texel_bytes_; }
  /// In order of their offsets.
  const std::vector<CropKey>& keys() const { return keys_; }

 private:
  struct Hash {
    size_t operator()(const CropKey& key) const;
  };
  std::unordered_map<CropKey, uint32_t, Hash> offsets_;  // looked up, never iterated
  std::vector<CropKey> keys_;
  uint64_t texel_bytes_ = 0;
};

}  // namespace shoal
