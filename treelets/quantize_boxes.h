// Child boxes of a wide node to the 8-bit grid of QuantizedNode. Called by treelets/pack_treelet. Pure.
// Every plane is evaluated in float and stepped outwards until it encloses the child, so rounding is checked, not
// argued about. (The kernels multiply it out with the ray, which then is wider: ray_space.h.)
#pragma once

#include <span>

#include "treelets/treelet_layout.h"
#include "treelets/vector.h"

namespace shoal {

/// 2^exponent stays a normal number, so that traversal may build it from bits.
inline constexpr int kMinGridExponent = -126;
inline constexpr int kMaxGridExponent = 127;

/// The plane: one exact multiplication, one rounded addition.
inline float grid_plane(float origin, uint32_t q, float step) { return origin + static_cast<float>(q) * step; }

/// Sets origin, exponent, child_count, lo and hi of `node`; empty slots as the layout says. `boxes` has 1..8 boxes.
/// Coordinates up to kMaxCoordinate (treelets/build_object.h) give finite planes only; beyond, a child may be enclosed
/// by an infinite one.
void quantize_boxes(std::span<const Bounds3> boxes, QuantizedNode& node);

}  // namespace shoal
