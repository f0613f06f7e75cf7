// From a hit to a place that can be shaded: point with error bound, normals, uv, vertex colour. The triangle is
// intersected once more for its barycentrics, by traversal's own arithmetic. Called by engine/shade. Pure; about
// 200 ns.
//
// Faces are two-sided. The geometric normal is turned towards the ray; the shading normal follows to its side, and
// a normal map is applied on the front before that, as glTF asks (the whole frame turns with the face).
#pragma once

#include <cstddef>
#include <span>

#include "engine/path_state.h"
#include "engine/surface_error.h"
#include "treelets/top_tree.h"
#include "treelets/trace_treelet.h"

namespace shoal {

struct Surface {
  BoundedPoint position;
  Vec3 wo{0};                ///< unit, back along the ray
  Vec3 geometric_normal{0};  ///< unit, world space, dot(geometric_normal, wo) >= 0; zero when it is not defined
  Vec3 front_normal{0};      ///< unit shading normal of the front face, before any normal map
  Vec3 tangent{0};           ///< world space, from the corners; zero when they have none
  float handedness = 1;
  bool front = true;  ///< the shading normal of the side seen is front_normal, else its negative
  TriangleAttributes attributes;
  float b1 = 0, b2 = 0;     ///< barycentrics of the second and third corner
  Vec3 edge1{0}, edge2{0};  ///< world space
  bool mirrored = false;    ///< the instance's transform has a negative determinant

  Vec2 uv(uint32_t set) const;
  Vec4 color() const;
};

/// `geometry` and `attributes` as for Shader::shade_hit. Requires: path.hit.valid().
Surface find_surface(const PathState& path, const Instance& instance, std::span<const std::byte> geometry,
                     std::span<const std::byte> attributes, TriangleTest test = TriangleTest::kWatertight);

/// The front normal bent by a tangent-space normal (glTF: x along the tangent, y along the bitangent, z out).
/// Tangents come from the corners or, where those are zero, from the derivatives of uv set `uv_set` over the
/// triangle, a face at a time; without either the front normal stays.
/// `uv_transform` (TextureTransform::m, or null) is what the uv are taken through before the picture is looked up: the
/// derivatives follow it, so that relief turns with its texture.
Vec3 map_normal(const Surface& surface, const Vec3& tangent_space_normal, uint32_t uv_set,
                const float* uv_transform = nullptr);

struct TangentFrame {
  Vec3 tangent{0}, bitangent{0};  ///< unit; zero: none is known
};
/// Tangent and bitangent of the front face, as map_normal() has them.
TangentFrame tangent_frame(const Surface& surface, uint32_t uv_set, const float* uv_transform = nullptr);

/// The shading normal for the side seen: `front_normal` turned to it, then leaned towards the geometric normal as
/// far as needed for dot(normal, wo) >= kMinViewRatio * dot(geometric normal, wo), so that no pixel of an
/// interpolated or mapped normal is seen from behind. Continuous in its arguments.
Vec3 facing_normal(const Surface& surface, const Vec3& front_normal);
inline constexpr float kMinViewRatio = 0.1f;  ///< a matter of looks: lobes get this narrow, not narrower

}  // namespace shoal
