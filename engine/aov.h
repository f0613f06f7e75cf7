// The layers that a picture can have beside its colour (`--aov`): their names, and a set of them. What each holds is said
// in docs/aovs.md. Called by bins and engine/render_*. Plain values.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/result.h"

namespace shoal {

enum class Aov : uint8_t {
  kAlbedo,
  kNormal,
  kDepth,
  kPosition,
  kVariance,
  kSamples,
  kObjectId,
  kMaterialId,
  kTreelets,
  kBytes,
};
inline constexpr uint32_t kAovCount = 10;

struct AovInfo {
  std::string_view name;      ///< as --aov has it
  std::string_view channels;  ///< a letter each: `albedo.R`, `albedo.G`, `albedo.B`
  uint32_t sum_bytes;         ///< a pixel, while rendering
};
/// By Aov.
const AovInfo& aov_info(Aov aov);

struct AovSet {
  uint32_t bits = 0;

  bool has(Aov aov) const { return (bits >> static_cast<uint32_t>(aov) & 1) != 0; }
  void add(Aov aov) { bits |= 1u << static_cast<uint32_t>(aov); }
  bool empty() const { return bits == 0; }
  /// Any that is taken from a vertex of the path.
  bool of_surface() const;
};

/// "albedo,normal", "all"; empty: none. Fails with: kUsage (names the choices).
Result<AovSet> parse_aovs(const std::string& text);
/// Their names in order.
std::vector<std::string> aov_names(AovSet set);

}  // namespace shoal
