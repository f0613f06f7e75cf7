// The bytes of a treelet's attribute page: what shading needs beyond positions. Absent when the treelet has one
// material and no attributes. Corners that are equal in every attribute are stored once.
//
//   AttributeHeader | uint32 material[triangle_count] (only when uniform_material == kNoIndex)
//                   | corner index[3 * triangle_count], uint16 or uint32, padded to 4 (only when vertex_count > 0)
//                   | float vertex[vertex_count][floats]
// Triangles are in ordinal order (LeafHeader::first_ordinal). A vertex's floats are those of CornerLayout, in its order.
#pragma once

#include <cstdint>

namespace shoal {

inline constexpr uint32_t kAttributeMagic = 0x52545441u;  // "ATTR"

struct AttributeHeader {
  uint32_t magic;
  uint32_t triangle_count;
  uint32_t uniform_material;   ///< kNoIndex: one a triangle
  uint32_t vertex_count;       ///< 0: no attributes
  uint8_t has_normal, has_tangent, has_color, uv_count;
  uint8_t index_bytes;         ///< 2 or 4
  uint8_t reserved8[3];
  uint32_t materials_offset;   ///< 0: none
  uint32_t indices_offset;     ///< 0: none
  uint32_t vertices_offset;    ///< 0: none
  uint32_t reserved[7];
};
static_assert(sizeof(AttributeHeader) == 64);

}  // namespace shoal
