// A ray against all triangles of a leaf at once. Included once a target (foreach_target.h).
#if defined(SHOAL_TREELETS_LEAF_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_LEAF_KERNEL_INL_H
#undef SHOAL_TREELETS_LEAF_KERNEL_INL_H
#else
#define SHOAL_TREELETS_LEAF_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/treelet_view.h"
#include "treelets/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using F16 = hn::CappedTag<float, 16>;
using I16 = hn::RebindToSigned<F16>;
using V16 = hn::Vec<F16>;
inline constexpr size_t kLeafLanes = hn::MaxLanes(F16());
/// 16 u more than t: out_of_reach().
inline constexpr float kReachScale = 1 + 0x1p-20f;

struct ShearedLanes {
  V16 x, y, z;  ///< z: along RaySpace::kz from the origin, not sheared
};

/// Of a leaf that has_bits(): load_vertices().
HWY_INLINE V16 load_bits(const LeafView& leaf, uint32_t axis, size_t first) {
  const I16 i;
  const auto low = hn::PromoteTo(i, hn::LoadU(hn::Rebind<uint16_t, F16>(), leaf.low(axis) + first));
  const auto high = hn::PromoteTo(i, hn::LoadU(hn::Rebind<uint8_t, F16>(), leaf.high(axis) + first));
  const auto above = hn::And(hn::ShiftLeft<16>(high), hn::Set(i, leaf.has_high(axis) ? -1 : 0));
  return hn::BitCast(F16(), hn::Add(hn::Or(low, above), hn::Set(i, static_cast<int32_t>(leaf.base(axis)))));
}

struct GridLanes {
  V16 steps, step;  ///< a coordinate is their product, which is exact
};

/// Of a leaf that has_grid().
HWY_INLINE GridLanes load_grid(const LeafView& leaf, uint32_t axis, size_t first) {
  const I16 i;
  const hn::Rebind<uint8_t, F16> bytes;
  const auto low = hn::PromoteTo(i, hn::LoadU(bytes, leaf.grid_low(axis) + first));
  const auto high = hn::PromoteTo(i, hn::LoadU(bytes, leaf.grid_high(axis) + first));
  const auto above = hn::And(hn::ShiftLeft<8>(high), hn::Set(i, leaf.has_high(axis) ? -1 : 0));
  const auto word = hn::Set(i, static_cast<int32_t>(leaf.base(axis)));
  const auto steps = hn::Add(hn::Or(low, above), hn::ShiftRight<8>(word));
  const auto step = hn::ShiftRight<1>(hn::BitCast(hn::RebindToUnsigned<F16>(), hn::ShiftLeft<24>(word)));
  return {hn::ConvertTo(F16(), steps), hn::BitCast(F16(), step)};
}

/// A coordinate of the vertices from `first` on. Reads past the last vertex, inside the page and 64 bytes after it.
HWY_INLINE V16 load_vertices(const LeafView& leaf, uint32_t axis, size_t first) {
  if (leaf.has_bits()) return load_bits(leaf, axis, first);
  if (leaf.has_floats()) return hn::LoadU(F16(), leaf.floats(axis) + first);
  const GridLanes lanes = load_grid(leaf, axis, first);
  return hn::Mul(lanes.steps, lanes.step);
}

/// The same less that of the ray's origin. On a grid the product is exact: fused or not, the same bits.
HWY_INLINE V16 load_from_origin(const RaySpace& ray, const LeafView& leaf, uint32_t axis, size_t first) {
  const auto origin = hn::Set(F16(), ray.origin[axis]);
  if (leaf.has_bits()) return hn::Sub(load_bits(leaf, axis, first), origin);
  if (leaf.has_floats()) return hn::Sub(hn::LoadU(F16(), leaf.floats(axis) + first), origin);
  const GridLanes lanes = load_grid(leaf, axis, first);
  return hn::MulSub(lanes.steps, lanes.step, origin);
}

/// The vertices from `first` on, translated and sheared: shear() of triangle_test.h.
HWY_INLINE ShearedLanes shear_vertices(const RaySpace& ray, const LeafView& leaf, size_t first) {
  const F16 f;
  const auto x = load_from_origin(ray, leaf, ray.kx, first), y = load_from_origin(ray, leaf, ray.ky, first);
  const auto z = load_from_origin(ray, leaf, ray.kz, first);
  return {hn::Sub(x, hn::Mul(hn::Set(f, ray.shear_x), z)), hn::Sub(y, hn::Mul(hn::Set(f, ray.shear_y), z)), z};
}

HWY_INLINE hn::Vec<I16> corner_indices(const LeafView& leaf, uint32_t k, size_t first) {
  return hn::PromoteTo(I16(), hn::LoadU(hn::Rebind<uint8_t, F16>(), leaf.corner(k) + first));
}

#if HWY_MAX_BYTES >= 64
/// The sheared corners of the leaf's triangles, a lane a triangle: vertices are sheared once and then looked up in
/// registers. Lanes past the last triangle hold anything.
struct LeafCorners {
  ShearedLanes corner[3];

  HWY_INLINE LeafCorners(const RaySpace& ray, const LeafView& leaf) {
    const F16 f;
    const I16 i;
    ShearedLanes table = shear_vertices(ray, leaf, 0);
    hn::Vec<I16> index[3];
    for (uint32_t k = 0; k < 3; ++k) {
      index[k] = corner_indices(leaf, k, 0);
      const auto lanes = hn::IndicesFromVec(f, hn::And(index[k], hn::Set(i, 15)));
      corner[k] = {hn::TableLookupLanes(table.x, lanes), hn::TableLookupLanes(table.y, lanes),
                   hn::TableLookupLanes(table.z, lanes)};
    }
    for (uint32_t first = 16; first < leaf.vertex_count; first += 16) {
      table = shear_vertices(ray, leaf, first);
      for (uint32_t k = 0; k < 3; ++k) {
        const auto lanes = hn::IndicesFromVec(f, hn::And(index[k], hn::Set(i, 15)));
        const auto here = hn::RebindMask(f, hn::Gt(index[k], hn::Set(i, static_cast<int32_t>(first) - 1)));
        corner[k] = {hn::IfThenElse(here, hn::TableLookupLanes(table.x, lanes), corner[k].x),
                     hn::IfThenElse(here, hn::TableLookupLanes(table.y, lanes), corner[k].y),
                     hn::IfThenElse(here, hn::TableLookupLanes(table.z, lanes), corner[k].z)};
      }
    }
  }
  HWY_INLINE ShearedLanes at(uint32_t k, size_t) const { return corner[k]; }
};
#else
/// The same for narrower vectors: sheared vertices go through memory.
struct LeafCorners {
  HWY_ALIGN float x[kMaxLeafVertices + kLeafLanes], y[kMaxLeafVertices + kLeafLanes],
      z[kMaxLeafVertices + kLeafLanes];
  const LeafView& leaf;

  HWY_INLINE LeafCorners(const RaySpace& ray, const LeafView& view) : leaf(view) {
    for (size_t first = 0; first < leaf.vertex_count; first += kLeafLanes) {
      const ShearedLanes sheared = shear_vertices(ray, leaf, first);
      hn::StoreU(sheared.x, F16(), x + first);
      hn::StoreU(sheared.y, F16(), y + first);
      hn::StoreU(sheared.z, F16(), z + first);
    }
  }
  HWY_INLINE ShearedLanes at(uint32_t k, size_t first) const {
    // Lanes past the last triangle hold other bytes: kept inside the leaf, their result is dropped.
    const auto last = hn::Set(I16(), static_cast<int32_t>(leaf.vertex_count) - 1);
    const auto index = hn::Min(corner_indices(leaf, k, first), last);
    return {hn::GatherIndex(F16(), x, index), hn::GatherIndex(F16(), y, index), hn::GatherIndex(F16(), z, index)};
  }
};
#endif

/// Lanes whose edge functions have certainly different signs, by the float arithmetic of triangle_test.h.
HWY_INLINE hn::Mask<F16> edges_differ(const ShearedLanes corner[3]) {
  const F16 f;
  auto positive = hn::Lt(hn::Zero(f), hn::Zero(f)), negative = positive;
  const int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
  for (int e = 0; e < 3; ++e) {
    const auto product = hn::Mul(corner[from[e]].y, corner[to[e]].x);
    const auto value = hn::MulSub(corner[from[e]].x, corner[to[e]].y, product);
    const auto bound = hn::MulAdd(hn::Set(f, kEdgeError), hn::Abs(product), hn::Set(f, kEdgeUnderflow));
    positive = hn::Or(positive, hn::Gt(value, bound));
    negative = hn::Or(negative, hn::Lt(value, hn::Neg(bound)));
  }
  return hn::And(positive, negative);
}

/// Lanes whose edge functions by TriangleTest::kFast have different signs: never fused, so the bits of triangle_test.h.
HWY_INLINE hn::Mask<F16> float_edges_differ(const ShearedLanes corner[3]) {
  const F16 f;
  const auto none = hn::Zero(f);
  auto positive = hn::Lt(none, none), negative = positive;
  const int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
  for (int e = 0; e < 3; ++e) {
    const auto value = hn::Sub(hn::Mul(corner[from[e]].x, corner[to[e]].y), hn::Mul(corner[from[e]].y, corner[to[e]].x));
    positive = hn::Or(positive, hn::Gt(value, none));
    negative = hn::Or(negative, hn::Lt(value, none));
  }
  return hn::And(positive, negative);
}

/// Lanes whose edge functions by TriangleTest::kDouble have certainly different signs. Sheared corners in float err by
/// half of `pad` (RaySpace::pad) and little more an axis, so an edge function errs by (|ax| + |ay| + |bx| + |by| + pad)
/// pad / 2 beside what edges_differ() allows for.
HWY_INLINE hn::Mask<F16> double_edges_differ(const ShearedLanes corner[3], V16 pad) {
  const F16 f;
  auto positive = hn::Lt(hn::Zero(f), hn::Zero(f)), negative = positive;
  const int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
  for (int e = 0; e < 3; ++e) {
    const ShearedLanes &a = corner[from[e]], &b = corner[to[e]];
    const auto product = hn::Mul(a.y, b.x);
    const auto value = hn::MulSub(a.x, b.y, product);
    const auto size = hn::Add(hn::Add(hn::Add(hn::Abs(a.x), hn::Abs(a.y)), hn::Add(hn::Abs(b.x), hn::Abs(b.y))), pad);
    const auto rounding = hn::MulAdd(hn::Set(f, kEdgeError), hn::Abs(product), hn::Set(f, kEdgeUnderflow));
    const auto bound = hn::MulAdd(size, pad, rounding);
    positive = hn::Or(positive, hn::Gt(value, bound));
    negative = hn::Or(negative, hn::Lt(value, hn::Neg(bound)));
  }
  return hn::And(positive, negative);
}

/// Lanes that a test of this kind certainly rejects for its edges.
template <TriangleTest kTest>
HWY_INLINE hn::Mask<F16> edges_reject(const RaySpace& ray, const ShearedLanes corner[3]) {
  if constexpr (kTest == TriangleTest::kFast) return float_edges_differ(corner);
  if constexpr (kTest == TriangleTest::kDouble) return double_edges_differ(corner, hn::Set(F16(), ray.pad));
  return edges_differ(corner);
}

/// Lanes whose triangle the exact test leaves out for where it begins and ends along RaySpace::kz: its own box
/// (triangle_test.h) is entered behind `t` or left before the ray begins. `inverse`: RaySpace::inverse along kz; `pads`:
/// two of RaySpace::pad, as t. The box has one pad, and roundings of about u R (ray_space.h), which are less than
/// another; kReachScale has room for those of z, of the products and of t's own.
HWY_INLINE hn::Mask<F16> out_of_reach(const ShearedLanes corner[3], V16 inverse, V16 pads, V16 t) {
  const auto a = hn::Mul(corner[0].z, inverse), b = hn::Mul(corner[1].z, inverse), c = hn::Mul(corner[2].z, inverse);
  const auto last = hn::MulAdd(t, hn::Set(F16(), kReachScale), pads);
  return hn::Or(hn::Gt(hn::Min(hn::Min(a, b), c), last), hn::Lt(hn::Max(hn::Max(a, b), c), hn::Neg(pads)));
}

/// The triangles of a leaf that the test of this kind may accept at or before `t`.
template <TriangleTest kTest = TriangleTest::kWatertight>
HWY_INLINE uint32_t find_candidates(const RaySpace& ray, const LeafView& leaf, float t) {
  const F16 f;
  const LeafCorners corners(ray, leaf);
  const float inverse = ray.inverse[ray.kz];
  const auto pads = hn::Set(f, 2 * ray.pad * std::abs(inverse));
  uint32_t rejected = 0;
  for (size_t first = 0; first < leaf.triangle_count; first += kLeafLanes) {
    const ShearedLanes corner[3] = {corners.at(0, first), corners.at(1, first), corners.at(2, first)};
    uint8_t bits[8] = {};
    const auto behind = out_of_reach(corner, hn::Set(f, inverse), pads, hn::Set(f, t));
    hn::StoreMaskBits(f, hn::Or(edges_reject<kTest>(ray, corner), behind), bits);
    rejected |= (uint32_t{bits[0]} | uint32_t{bits[1]} << 8) << first;
  }
  return ~rejected & ((1u << leaf.triangle_count) - 1);
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
