// A decoded geometry page seen through its layout (treelets/treelet_layout.h): pointers into the page, nothing copied.
// Made by whoever reads a treelet. Requires: the page passed check_treelet(). Cost: a few additions.
#pragma once

#include <cstddef>
#include <span>

#include "treelets/treelet_layout.h"
#include "treelets/vector.h"

namespace shoal {

struct LeafView {
  const LeafHeader* header;
  const float* axis[3];     ///< x[], y[], z[] of the vertices
  const uint8_t* corner[3]; ///< i0[], i1[], i2[] of the triangles

  explicit LeafView(const std::byte* leaf) : header(reinterpret_cast<const LeafHeader*>(leaf)) {
    const uint32_t vertex_count = header->vertex_count;
    axis[0] = reinterpret_cast<const float*>(leaf + sizeof(LeafHeader));
    axis[1] = axis[0] + vertex_count;
    axis[2] = axis[1] + vertex_count;
    corner[0] = reinterpret_cast<const uint8_t*>(axis[2] + vertex_count);
    corner[1] = corner[0] + header->triangle_count;
    corner[2] = corner[1] + header->triangle_count;
  }
  Vec3 vertex(uint32_t i) const { return {axis[0][i], axis[1][i], axis[2][i]}; }
  Vec3 position(uint32_t triangle, int k) const { return vertex(corner[k][triangle]); }
};

struct TreeletView {
  const std::byte* page;
  const TreeletHeader* header;
  const QuantizedNode* nodes;

  explicit TreeletView(std::span<const std::byte> bytes)
      : page(bytes.data()),
        header(reinterpret_cast<const TreeletHeader*>(page)),
        nodes(reinterpret_cast<const QuantizedNode*>(page + sizeof(TreeletHeader))) {}

  /// `offset` in units of 4 bytes, as in NodeRef and Hit::slot.
  LeafView leaf(uint32_t offset) const { return LeafView(page + header->leaves_offset + size_t{4} * offset); }
  const uint32_t* primitives() const { return reinterpret_cast<const uint32_t*>(page + header->primitives_offset); }
  /// Requires: header->coverage_offset != 0.
  const uint32_t* coverage_of() const { return reinterpret_cast<const uint32_t*>(page + header->coverage_offset); }
  const CoverageRecord* coverage_records() const {
    return reinterpret_cast<const CoverageRecord*>(coverage_of() + header->triangle_count);
  }
  const uint8_t* coverage_texels() const {
    return reinterpret_cast<const uint8_t*>(coverage_records() + header->coverage_record_count);
  }
};

/// Bytes of a leaf, padded to 4.
inline constexpr uint32_t leaf_bytes(uint32_t triangle_count, uint32_t vertex_count) {
  return (static_cast<uint32_t>(sizeof(LeafHeader)) + 12 * vertex_count + 3 * triangle_count + 3) & ~3u;
}

}  // namespace shoal
