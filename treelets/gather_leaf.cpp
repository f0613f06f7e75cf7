#include "treelets/gather_leaf.h"

#include <cstring>

namespace shoal {

void gather_leaf(std::span<const float> positions, std::span<const uint32_t> triangles, LeafVertices& leaf) {
  // Open addressing over 64 places for at most 24 vertices; a place holds a vertex's index plus one.
  uint8_t place[64] = {};
  leaf.triangle_count = static_cast<uint32_t>(triangles.size());
  uint32_t count = 0;
  for (uint32_t t = 0; t < leaf.triangle_count; ++t) {
    uint32_t corners[9];
    std::memcpy(corners, &positions[9 * static_cast<size_t>(triangles[t])], sizeof corners);
    for (uint32_t c = 0; c < 3; ++c) {
      const uint32_t* p = corners + 3 * c;
      uint32_t hash = (p[0] * 0x9e3779b1u ^ p[1] * 0x85ebca77u ^ p[2] * 0xc2b2ae3du);
      hash = (hash ^ hash >> 15) * 0x9e3779b1u >> 26;
      for (;; hash = (hash + 1) & 63) {
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

}  // namespace shoal
