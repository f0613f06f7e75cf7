// Emissive triangles as lights: the table that light sampling draws from.
// Called by engine/build_scene for each object, then for each of its instances. Cost: one pass over the object.
#pragma once

#include <span>
#include <vector>

#include "engine/scene_tables.h"
#include "io/result.h"
#include "treelets/triangle_soup.h"

namespace shoal {

/// 72 bytes each, resident while rendering: more is refused.
inline constexpr uint64_t kMaxEmitters = 1u << 25;

/// Of a triangle with these nine floats; in double, where the products of floats neither overflow nor vanish.
bool has_area(const float* p);

/// The emissive triangles of an object, in object space, in order of primitive; instance is 0.
std::vector<Emitter> collect_emitters(const TriangleSoup& soup, std::span<const Material> materials);

/// Appends them as `instance` shows them (as they are, where it is an identity): positions by Affine3::point in float, as shading moves them. Triangles
/// without area are left out. Fails with: kInput (more than kMaxEmitters).
Status append_emitters(std::span<const Emitter> of_object, const Instance& instance, uint32_t instance_index,
                       std::vector<Emitter>& out);

}  // namespace shoal
