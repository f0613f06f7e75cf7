// What a ray of a picture was born as, finer than RayKind (engine/counters.h): how rays of it run together is a property
// of these, so figures are told apart by them. Set by the shader where rays are made; read by engine/ray_recorder only.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace shoal {

enum class RayBirth : uint8_t {
  kCamera,
  kPointShadow,   ///< to a point, spot or directional light: of one place all end in one point or run one way
  kAreaShadow,    ///< to an emissive triangle or the environment picture
  kMirror,        ///< bounces of reflecting lobes, below kMirrorAlpha
  kGlossy,        ///< of rougher ones
  kDiffuse,       ///< of the diffuse lobe, diffuse transmission and sheen
  kTransmission,  ///< through glass and thin walls
};
inline constexpr std::array<std::string_view, 7> kRayBirthNames{"camera", "point-shadow", "area-shadow",
                                                                "mirror", "glossy",       "diffuse",
                                                                "transmission"};

/// A lobe up to this alpha (perceptual roughness 0.1) is a mirror: half of its half vectors are within 0.6 degrees of the
/// normal (GGX: tan = alpha), so a reflection is seen sharp. No lobe is a delta here (kMinAlpha, engine/microfacet.h).
inline constexpr float kMirrorAlpha = 0.01f;

inline RayBirth birth_of_reflection(float alpha) { return alpha <= kMirrorAlpha ? RayBirth::kMirror : RayBirth::kGlossy; }

}  // namespace shoal
