#include "treelets/gather_leaf.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "io/result.h"
#include "treelets/treelet_view.h"

namespace shoal {

void gather_leaf(const TriangleSoup& soup, std::span<const uint32_t> triangles, LeafVertices& leaf) {
  // Open addressing over 128 places for at most 48 vertices; a place holds a vertex's index plus one.
  uint8_t place[128] = {};
  leaf.step = soup.position_step;
  leaf.triangle_count = static_cast<uint32_t>(triangles.size());
  uint32_t count = 0;
  for (uint32_t t = 0; t < leaf.triangle_count; ++t) {
    uint32_t corners[9];
    std::memcpy(corners, &soup.positions[9 * static_cast<size_t>(triangles[t])], sizeof corners);
    for (uint32_t c = 0; c < 3; ++c) {
      const uint32_t* p = corners + 3 * c;
      uint32_t hash = (p[0] * 0x9e3779b1u ^ p[1] * 0x85ebca77u ^ p[2] * 0xc2b2ae3du);
      hash = (hash ^ hash >> 15) * 0x9e3779b1u >> 25;
      for (;; hash = (hash + 1) & 127) {
        const uint32_t v = place[hash];
        if (v == 0) {
          for (int axis = 0; axis < 3; ++axis) leaf.bits[axis][count] = p[axis];
          place[hash] = static_cast<uint8_t>(++count);
          leaf.index[c][t] = static_cast<uint8_t>(count - 1);
          break;
        }
        if (leaf.bits[0][v - 1] == p[0] && leaf.bits[1][v - 1] == p[1] && leaf.bits[2][v - 1] == p[2]) {
          leaf.index[c][t] = static_cast<uint8_t>(v - 1);
          break;
        }
      }
    }
  }
  leaf.vertex_count = count;
}

namespace {

struct BitRange {
  uint32_t least, most;
  static BitRange of(std::span<const uint32_t> values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return {*least, *most};
  }
  uint32_t span() const { return most - least; }
};

BitRange axis_bits(const LeafVertices& leaf, int axis) { return BitRange::of({leaf.bits[axis], leaf.vertex_count}); }

/// Where the vertices of an axis lie on the grid, or that they do not.
struct AxisSteps {
  int32_t steps[kMaxLeafVertices];
  int32_t least = 0;
  uint32_t span = 0;
  bool fits = false;

  AxisSteps(const LeafVertices& leaf, int axis) {
    if (leaf.step == 0) return;
    int32_t most = -kMaxGridSteps;
    least = kMaxGridSteps;
    for (uint32_t v = 0; v < leaf.vertex_count; ++v) {
      const float value = std::bit_cast<float>(leaf.bits[axis][v]) / leaf.step;  // nothing is rounded
      if (!(std::abs(value) <= static_cast<float>(kMaxGridSteps))) return;
      const auto whole = static_cast<int32_t>(value);
      if (std::bit_cast<uint32_t>(static_cast<float>(whole) * leaf.step) != leaf.bits[axis][v]) return;  // -0 too
      steps[v] = whole;
      least = std::min(least, whole), most = std::max(most, whole);
    }
    span = static_cast<uint32_t>(most - least);
    fits = span < 1u << 16;
  }
};

template <class T>
void append_value(std::vector<std::byte>& bytes, T value) {
  const auto* begin = reinterpret_cast<const std::byte*>(&value);
  bytes.insert(bytes.end(), begin, begin + sizeof value);
}

void append_grid_positions(const LeafVertices& leaf, uint8_t flags, std::vector<std::byte>& bytes) {
  const AxisSteps axes[3] = {{leaf, 0}, {leaf, 1}, {leaf, 2}};
  const uint32_t exponent = std::bit_cast<uint32_t>(leaf.step) >> 23;
  for (const AxisSteps& axis : axes) append_value(bytes, static_cast<uint32_t>(axis.least) << 8 | exponent);
  const auto offset = [&](int axis, uint32_t v) {
    return static_cast<uint32_t>(axes[axis].steps[v] - axes[axis].least);
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (uint32_t v = 0; v < leaf.vertex_count; ++v) append_value(bytes, static_cast<uint8_t>(offset(axis, v)));
  }
  for (int axis = 0; axis < 3; ++axis) {
    if ((flags >> axis & 1) == 0) continue;
    for (uint32_t v = 0; v < leaf.vertex_count; ++v) append_value(bytes, static_cast<uint8_t>(offset(axis, v) >> 8));
  }
}

void append_positions(const LeafVertices& leaf, uint8_t flags, std::vector<std::byte>& bytes) {
  if ((flags & kLeafGrid) != 0) return append_grid_positions(leaf, flags, bytes);
  const auto each_vertex = [&](const auto& append) {
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t base = axis_bits(leaf, axis).least;
      for (uint32_t v = 0; v < leaf.vertex_count; ++v) append(axis, leaf.bits[axis][v], leaf.bits[axis][v] - base);
    }
  };
  if ((flags & kLeafFloats) != 0) {
    each_vertex([&](int, uint32_t value, uint32_t) { append_value(bytes, value); });
    return;
  }
  for (int axis = 0; axis < 3; ++axis) append_value(bytes, axis_bits(leaf, axis).least);
  each_vertex([&](int, uint32_t, uint32_t offset) { append_value(bytes, static_cast<uint16_t>(offset)); });
  each_vertex([&](int axis, uint32_t, uint32_t offset) {
    if ((flags >> axis & 1) != 0) append_value(bytes, static_cast<uint8_t>(offset >> 16));
  });
}

/// How the positions are laid out: flags of the leaf.
uint8_t plan_positions(const LeafVertices& leaf) {
  uint8_t flags = 0, grid_flags = kLeafGrid;
  bool on_grid = true;
  for (int axis = 0; axis < 3; ++axis) {
    const AxisSteps steps(leaf, axis);
    on_grid = on_grid && steps.fits;
    if (steps.span >= 1u << 8) grid_flags |= static_cast<uint8_t>(1u << axis);
  }
  if (on_grid) return grid_flags;
  for (int axis = 0; axis < 3; ++axis) {
    const uint32_t span = axis_bits(leaf, axis).span();  // of both signs: 2^31 and more
    if (span >= 1u << 24) return kLeafFloats;
    if (span >= 1u << 16) flags |= static_cast<uint8_t>(1u << axis);
  }
  return flags;
}

}  // namespace

LeafHeader plan_leaf(const LeafVertices& leaf, std::span<const uint32_t> primitives) {
  LeafHeader header{};
  header.triangle_count = static_cast<uint8_t>(leaf.triangle_count);
  header.vertex_count = static_cast<uint8_t>(leaf.vertex_count);
  header.flags = plan_positions(leaf);
  const BitRange ids = BitRange::of(primitives);
  header.first_primitive = ids.least;
  header.primitive_bytes = static_cast<uint8_t>((std::bit_width(ids.span()) + 7) / 8);
  return header;
}

void append_leaf(const LeafVertices& leaf, const LeafHeader& header, std::span<const uint32_t> primitives,
                 std::vector<std::byte>& bytes) {
  const size_t begin = bytes.size();
  const LeafParts parts = LeafParts::of(header);
  append_value(bytes, header);
  append_positions(leaf, header.flags, bytes);
  for (const auto& corner : leaf.index) {
    for (uint32_t t = 0; t < leaf.triangle_count; ++t) append_value(bytes, corner[t]);
  }
  for (uint32_t byte = 0; byte < header.primitive_bytes; ++byte) {
    for (const uint32_t id : primitives) {
      append_value(bytes, static_cast<uint8_t>((id - header.first_primitive) >> (8 * byte)));
    }
  }
  SHOAL_CHECK(bytes.size() == begin + parts.end);
  bytes.resize(begin + parts.padded_bytes());
}

}  // namespace shoal
