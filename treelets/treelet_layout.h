// The bytes of a treelet's geometry page: what traversal touches, and nothing else. Written by treelets/pack_treelet,
// read by treelets/trace_treelet. Little-endian, offsets in bytes from the start of the page unless said otherwise.
//
//   TreeletHeader | QuantizedNode[node_count] | leaves | coverage
//
// Leaf (4-byte aligned, from leaves_offset), T triangles, V vertices:
//   LeafHeader | positions | uint8 i0[T] | i1[T] | i2[T] | primitives | pad to 4
// Vertices shared inside a leaf are stored once. i0,i1,i2 keep the corner order of the source: barycentrics do not
// depend on packing.
//
// Positions are float32, in one of three forms, all of which give back the very bits that were packed:
//   kLeafFloats    float x[V] | y[V] | z[V]
//   kLeafGrid      int32 word[3] | uint8 low[3][V] | uint8 high[V] of each axis with its kLeafHighX bit
//   neither        uint32 base[3] | uint16 low[3][V] | uint8 high[V] of each axis with its kLeafHighX bit
// Neither: the bits of a float are base + low + (high << 16). Neighbours differ in their low bits only, so this takes 6
// to 9 bytes a vertex instead of 12; what does not fit (bits of an axis that span 2^24 or more) is stored as floats.
// kLeafGrid, where a build rounds positions to a grid (engine/position_grid.h): a coordinate is
// ((word >> 8) + low + (high << 8)) * step, a whole number of less than 24 bits times a power of two, so that nothing is
// rounded; the low 8 bits of the axis' word are the exponent bits of `step` as a float. 3 to 6 bytes a vertex.
//
// Primitives: primitive_bytes planes of uint8[T], the lowest byte first; the id is their value + first_primitive.
//
// Coverage (only when coverage_offset != 0):
//   uint32 record[triangle_count] (index, kNoIndex: opaque) | CoverageRecord[record_count] | alpha texels
#pragma once

#include <cstddef>
#include <cstdint>

#include "treelets/ray.h"

namespace shoal {

inline constexpr uint32_t kTreeletMagic = 0x544c5254u;    // "TRLT"
inline constexpr uint32_t kMaxLeafTriangles = 16;
inline constexpr uint32_t kMaxLeafVertices = 48;
inline constexpr uint32_t kMaxTreeletDepth = 96;          ///< nodes from a root to a leaf; the packer checks it

struct TreeletHeader {
  uint32_t magic;
  uint32_t node_count;
  uint32_t leaves_offset;
  uint32_t leaves_bytes;
  uint32_t triangle_count;
  uint32_t uniform_material;   ///< kNoIndex: see the attribute page
  uint32_t coverage_offset;    ///< 0: every triangle is opaque
  uint32_t coverage_record_count;
  uint32_t coverage_texel_bytes;
  uint32_t reserved[7];        ///< zero
};
static_assert(sizeof(TreeletHeader) == 64);

/// A child of a node or a root: an inner node's index, or a leaf's offset.
using NodeRef = uint32_t;
inline constexpr NodeRef kEmptyRef = 0xffffffffu;
inline constexpr NodeRef kLeafBit = 0x80000000u;
inline constexpr bool is_leaf(NodeRef ref) { return (ref & kLeafBit) != 0; }
/// Offset of a leaf from leaves_offset, in units of 4 bytes (below 2^27, so that Hit::slot can hold it).
inline constexpr uint32_t leaf_offset(NodeRef ref) { return ref & ~kLeafBit; }

/// Child boxes on a grid of their own: plane = origin[axis] + q * 2^exponent[axis], evaluated in float by one exact
/// multiplication and one rounded addition. The packer makes sure that the evaluated planes enclose the child.
/// It keeps exponents in -126..127 (2^exponent is a normal number) and every plane finite.
/// An empty slot has child = kEmptyRef and lo > hi on every axis (lo = 255, hi = 0).
struct QuantizedNode {        // 96 bytes
  float origin[3];            //  0
  int8_t exponent[3];         // 12
  uint8_t child_count;        // 15  children fill the slots from 0
  NodeRef child[8];           // 16
  uint8_t lo[3][8];           // 48
  uint8_t hi[3][8];           // 72
};
static_assert(sizeof(QuantizedNode) == 96);

/// LeafHeader::flags.
inline constexpr uint8_t kLeafHighX = 1, kLeafHighY = 2, kLeafHighZ = 4;  ///< the axis has a plane of high bytes
inline constexpr uint8_t kLeafHighMask = 7;
inline constexpr uint8_t kLeafFloats = 8;     ///< positions as floats; no high planes
inline constexpr uint8_t kLeafCoverage = 16;  ///< some triangle has a coverage record
inline constexpr uint8_t kLeafGrid = 32;      ///< positions as steps of a grid; not with kLeafFloats
/// A leaf is on the grid only where every vertex is less than so many steps from zero.
inline constexpr int32_t kMaxGridSteps = (1 << 23) - 1;

struct LeafHeader {
  uint8_t triangle_count;     ///< 1 .. kMaxLeafTriangles
  uint8_t vertex_count;       ///< 3 .. kMaxLeafVertices
  uint8_t flags;
  uint8_t primitive_bytes;    ///< 0 .. 4
  uint32_t first_ordinal;     ///< of its first triangle among the treelet's triangles
  uint32_t first_primitive;   ///< the least primitive id of the leaf
};
static_assert(sizeof(LeafHeader) == 12);

/// Coverage of one triangle (treelets/coverage.h). uv are in texels of the chosen level, before wrapping, with
/// texel centres at +0.5; the crop holds texels [crop_x, crop_x + crop_width) x [crop_y, ...) of that unwrapped space,
/// or, when whole_level is 1, the level itself and coordinates wrap.
struct CoverageRecord {       // 80 bytes
  float uv[6];                //  0
  float vertex_alpha[3];      // 24
  float factor;               // 36
  float cutoff;               // 40
  int32_t crop_x, crop_y;     // 44
  uint32_t crop_width;        // 52  0: no texture, alpha = factor * vertex alpha
  uint32_t crop_height;       // 56
  uint32_t texel_offset;      // 60  from the first alpha texel, row by row
  uint8_t mode;               // 64  CoverageMode
  uint8_t wrap_u, wrap_v;     // 65  WrapMode, for whole_level
  uint8_t nearest;            // 67
  uint8_t whole_level;        // 68
  uint8_t reserved[11];       // 69
};
static_assert(sizeof(CoverageRecord) == 80);

}  // namespace shoal
