// A decoded geometry page seen through its layout (treelets/treelet_layout.h): pointers into the page, nothing
// copied. Made by whoever reads a treelet. Requires: the page passed check_treelet(). Cost: a few additions.
#pragma once

#include <cstddef>
#include <span>

#include "treelets/treelet_layout.h"
#include "treelets/vector.h"

namespace shoal {

struct LeafView {
  const std::byte* leaf;
  uint32_t triangle_count, vertex_count;

  explicit LeafView(const std::byte* at)
      : leaf(at), triangle_count(header().triangle_count), vertex_count(header().vertex_count) {}

  const LeafHeader& header() const { return *reinterpret_cast<const LeafHeader*>(leaf); }
  /// x[], y[] or z[] of the vertices.
  const float* axis(uint32_t k) const {
    return reinterpret_cast<const float*>(leaf + sizeof(LeafHeader)) + size_t{k} * vertex_count;
  }
  /// i0[], i1[] or i2[] of the triangles.
  const uint8_t* corner(uint32_t k) const {
    return reinterpret_cast<const uint8_t*>(axis(3)) + size_t{k} * triangle_count;
  }
  Vec3 position(uint32_t triangle, uint32_t k) const {
    const float* x = axis(0) + corner(k)[triangle];
    return {x[0], x[vertex_count], x[2 * size_t{vertex_count}]};
  }
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
