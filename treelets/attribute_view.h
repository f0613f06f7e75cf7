// A decoded attribute page seen through its layout (treelets/attribute_layout.h). Made by find_attributes and
// check_attributes. Requires: the header's offsets are checked before the arrays are read.
#pragma once

#include <cstddef>
#include <span>

#include "treelets/attribute_layout.h"
#include "treelets/triangle_soup.h"

namespace shoal {

struct AttributeView {
  const std::byte* page;
  const AttributeHeader* header;

  explicit AttributeView(std::span<const std::byte> bytes)
      : page(bytes.data()), header(reinterpret_cast<const AttributeHeader*>(page)) {}

  CornerLayout layout() const {
    return {header->has_normal != 0, header->has_tangent != 0, header->has_color != 0, header->uv_count};
  }
  /// Requires: materials_offset != 0.
  uint32_t material(uint32_t ordinal) const {
    return reinterpret_cast<const uint32_t*>(page + header->materials_offset)[ordinal];
  }
  /// Requires: vertex_count > 0.
  uint32_t vertex_index(uint64_t corner) const {
    const std::byte* indices = page + header->indices_offset;
    return header->index_bytes == 2 ? reinterpret_cast<const uint16_t*>(indices)[corner]
                                    : reinterpret_cast<const uint32_t*>(indices)[corner];
  }
  const float* vertex(uint32_t index) const {
    return reinterpret_cast<const float*>(page + header->vertices_offset) + uint64_t{layout().floats()} * index;
  }
};

}  // namespace shoal
