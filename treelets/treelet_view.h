// A decoded geometry page seen through its layout (treelets/treelet_layout.h): pointers into the page, nothing
// copied. Made by whoever reads a treelet. Requires: the page passed check_treelet(). Cost: a few additions.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <span>

#include "treelets/treelet_layout.h"
#include "treelets/vector.h"

namespace shoal {

/// How the vertices of a leaf lie, by its flags.
struct LeafForm {
  uint32_t start;         ///< of the vertices, in bytes from the leaf's start
  uint32_t vertex_bytes;  ///< of one vertex
};

/// Looked up: kernels ask for each leaf that they enter.
inline constexpr auto kLeafForms = [] {
  std::array<LeafForm, 64> forms{};
  for (uint8_t flags = 0; flags < forms.size(); ++flags) {
    const bool floats = (flags & kLeafFloats) != 0, grid = (flags & kLeafGrid) != 0;
    const int planes = std::popcount(static_cast<uint8_t>(flags & kLeafHighMask));
    forms[flags] = {static_cast<uint32_t>(sizeof(LeafHeader) + (floats ? 0 : 3 * sizeof(uint32_t))),
                    static_cast<uint32_t>(floats ? 12 : (grid ? 3 : 6) + planes)};
  }
  return forms;
}();

/// Where the parts of a leaf lie, in bytes from its start.
struct LeafParts {
  uint32_t corners;  ///< i0[], i1[], i2[]
  uint32_t end;      ///< before the padding

  static constexpr uint32_t kPositions = sizeof(LeafHeader);
  static constexpr uint32_t kLow = kPositions + 3 * sizeof(uint32_t);
  static constexpr LeafParts of(const LeafHeader& leaf) {
    const LeafForm& form = kLeafForms[leaf.flags % kLeafForms.size()];
    const uint32_t corners = form.start + form.vertex_bytes * leaf.vertex_count;
    return {corners, corners + (3u + leaf.primitive_bytes) * leaf.triangle_count};
  }
  constexpr uint32_t padded_bytes() const { return (end + 3) & ~3u; }
};

struct LeafView {
  const std::byte* leaf;
  uint32_t triangle_count, vertex_count;
  uint32_t corners;  ///< LeafParts::corners

  explicit LeafView(const std::byte* at)
      : leaf(at),
        triangle_count(header().triangle_count),
        vertex_count(header().vertex_count),
        corners(LeafParts::of(header()).corners) {}

  const LeafHeader& header() const { return *reinterpret_cast<const LeafHeader*>(leaf); }
  bool has_coverage() const { return (header().flags & kLeafCoverage) != 0; }
  bool has_floats() const { return (header().flags & kLeafFloats) != 0; }
  bool has_grid() const { return (header().flags & kLeafGrid) != 0; }
  /// Neither: the bits of floats, in parts.
  bool has_bits() const { return (header().flags & (kLeafFloats | kLeafGrid)) == 0; }
  /// Bytes with padding: where the next leaf begins.
  uint32_t bytes() const { return LeafParts::of(header()).padded_bytes(); }
  /// i0[], i1[] or i2[] of the triangles.
  const uint8_t* corner(uint32_t k) const { return bytes_at(corners) + size_t{k} * triangle_count; }

  /// x[], y[] or z[] of the vertices. Requires: has_floats().
  const float* floats(uint32_t axis) const {
    return reinterpret_cast<const float*>(leaf + LeafParts::kPositions) + size_t{axis} * vertex_count;
  }
  /// Requires for these: not has_floats(). high() and grid_high() of an axis without a plane are what follows in
  /// the leaf, whose corners alone are as many bytes (check_treelet: at most three vertices a triangle).
  uint32_t base(uint32_t axis) const {
    return reinterpret_cast<const uint32_t*>(leaf + LeafParts::kPositions)[axis];
  }
  /// has_bits(), these two.
  const uint16_t* low(uint32_t axis) const {
    return reinterpret_cast<const uint16_t*>(leaf + LeafParts::kLow) + size_t{axis} * vertex_count;
  }
  const uint8_t* high(uint32_t axis) const { return high_plane(LeafParts::kLow + 6 * vertex_count, axis); }
  /// has_grid(), these four.
  const uint8_t* grid_low(uint32_t axis) const { return bytes_at(LeafParts::kLow) + size_t{axis} * vertex_count; }
  const uint8_t* grid_high(uint32_t axis) const { return high_plane(LeafParts::kLow + 3 * vertex_count, axis); }
  int32_t grid_base(uint32_t axis) const { return static_cast<int32_t>(base(axis)) >> 8; }
  float grid_step(uint32_t axis) const { return std::bit_cast<float>((base(axis) & 0xff) << 23); }
  bool has_high(uint32_t axis) const { return (header().flags >> axis & 1) != 0; }

  float coordinate(uint32_t axis, uint32_t vertex) const {
    const uint32_t present = 0u - (header().flags >> axis & 1u);  // else this reads what follows, and drops it
    if (has_bits()) {
      return std::bit_cast<float>(base(axis) + low(axis)[vertex] + ((uint32_t{high(axis)[vertex]} & present) << 16));
    }
    if (has_floats()) return floats(axis)[vertex];
    const uint32_t steps = grid_low(axis)[vertex] + ((uint32_t{grid_high(axis)[vertex]} & present) << 8);
    return static_cast<float>(grid_base(axis) + static_cast<int32_t>(steps)) * grid_step(axis);
  }
  Vec3 position(uint32_t triangle, uint32_t k) const {
    const uint32_t vertex = corner(k)[triangle];
    return {coordinate(0, vertex), coordinate(1, vertex), coordinate(2, vertex)};
  }
  uint32_t primitive(uint32_t triangle) const {
    const uint8_t* plane = corner(3) + triangle;
    uint32_t id = 0;
    for (uint32_t byte = 0; byte < header().primitive_bytes; ++byte, plane += triangle_count) {
      id |= uint32_t{*plane} << (8 * byte);
    }
    return header().first_primitive + id;
  }

 private:
  const uint8_t* high_plane(uint32_t first_plane, uint32_t axis) const {
    const auto before = static_cast<uint8_t>(header().flags & ((1u << axis) - 1));
    return bytes_at(first_plane) + size_t{static_cast<uint32_t>(std::popcount(before))} * vertex_count;
  }
  const uint8_t* bytes_at(uint32_t offset) const { return reinterpret_cast<const uint8_t*>(leaf + offset); }
};

struct TreeletView {
  const std::byte* page;
  const TreeletHeader* header;
  const QuantizedNode* nodes;

  explicit TreeletView(std::span<const std::byte> bytes) : TreeletView(bytes.data()) {}
  explicit TreeletView(const std::byte* begin)
      : page(begin),
        header(reinterpret_cast<const TreeletHeader*>(page)),
        nodes(reinterpret_cast<const QuantizedNode*>(page + sizeof(TreeletHeader))) {}

  /// `offset` in units of 4 bytes, as in NodeRef and Hit::slot.
  LeafView leaf(uint32_t offset) const { return LeafView(page + header->leaves_offset + size_t{4} * offset); }
  /// Requires: header->coverage_offset != 0.
  const uint32_t* coverage_of() const { return reinterpret_cast<const uint32_t*>(page + header->coverage_offset); }
  const CoverageRecord* coverage_records() const {
    return reinterpret_cast<const CoverageRecord*>(coverage_of() + header->triangle_count);
  }
  const uint8_t* coverage_texels() const {
    return reinterpret_cast<const uint8_t*>(coverage_records() + header->coverage_record_count);
  }
};

}  // namespace shoal
