// What the builder takes: triangles without topology, each with its global id, its material and, for each of its
// corners, the shading attributes that its material calls for. Shared vertices are found again by their bits
// when a leaf is packed. Filled by engine/build_scene, consumed by treelets/build_object.
#pragma once

#include <cstdint>
#include <vector>

#include "treelets/vector.h"

namespace shoal {

/// Which attributes every corner of an object carries, in this order. Widths in floats.
struct CornerLayout {
  bool normal = false;   ///< 3 floats, object space, unit length; (0,0,0) means: use the geometric normal
  bool tangent = false;  ///< 4 floats: object-space unit tangent, w = handedness; (0,0,0,0) means: derive from uv set
  bool color = false;    ///< 4 floats, linear RGBA, multiplied with the base colour
  uint8_t uv_count = 0;  ///< 0..4 sets of 2 floats

  uint32_t normal_offset() const { return 0; }
  uint32_t tangent_offset() const { return normal ? 3 : 0; }
  uint32_t color_offset() const { return tangent_offset() + (tangent ? 4 : 0); }
  uint32_t uv_offset(uint32_t set) const { return color_offset() + (color ? 4 : 0) + 2 * set; }
  uint32_t floats() const { return uv_offset(uv_count); }
  bool operator==(const CornerLayout&) const = default;
};

struct TriangleSoup {
  CornerLayout layout;
  std::vector<float> positions;     ///< 9 a triangle: x0 y0 z0 x1 y1 z1 x2 y2 z2, object space, all finite
  std::vector<uint32_t> primitive;  ///< global primitive id, unique in the scene
  std::vector<uint32_t> material;
  std::vector<float> corners;       ///< 3 * layout.floats() a triangle
  /// A power of two that coordinates are multiples of, for leaves to be packed by; 0: none is known.
  float position_step = 0;

  size_t size() const { return primitive.size(); }
};

}  // namespace shoal
