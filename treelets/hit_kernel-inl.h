// One triangle of a leaf against one ray in lanes: the bits of intersect_triangle() (treelets/triangle_test.h), by the
// same operations in the same order. Included once a target (foreach_target.h).
#if defined(SHOAL_TREELETS_HIT_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_HIT_KERNEL_INL_H
#undef SHOAL_TREELETS_HIT_KERNEL_INL_H
#else
#define SHOAL_TREELETS_HIT_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include <bit>

#include "treelets/leaf_test.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

#if HWY_ARCH_X86 && HWY_MAX_BYTES >= 32  // Lanes (lane_box.h) is __m128 there

namespace hn = hwy::HWY_NAMESPACE;
using F4 = hn::FixedTag<float, 4>;
using D4 = hn::FixedTag<double, 4>;
using V4 = hn::Vec<F4>;

/// Of a leaf that is stored otherwise than as the bits of floats in parts.
HWY_INLINE V4 load_other_corners(const LeafView& leaf, uint32_t axis, const uint32_t vertex[3]) {
  if (leaf.has_floats()) {
    const float* at = leaf.floats(axis);
    return V4{lanes_set(at[vertex[0]], at[vertex[1]], at[vertex[2]])};
  }
  const uint8_t *low = leaf.grid_low(axis), *high = leaf.grid_high(axis);
  const uint32_t present = 0u - (leaf.header().flags >> axis & 1u);
  const int32_t base = leaf.grid_base(axis);
  const auto at = [&](uint32_t v) { return base + static_cast<int32_t>(low[v] + ((uint32_t{high[v]} & present) << 8)); };
  const hn::Vec<hn::FixedTag<int32_t, 4>> steps{_mm_setr_epi32(at(vertex[0]), at(vertex[1]), at(vertex[2]), 0)};
  return hn::Mul(hn::ConvertTo(F4(), steps), hn::Set(F4(), leaf.grid_step(axis)));
}

/// A coordinate of the three corners; the fourth lane is zero.
HWY_INLINE V4 load_corners(const LeafView& leaf, uint32_t axis, const uint32_t vertex[3]) {
  if (!leaf.has_bits()) return load_other_corners(leaf, axis, vertex);
  const uint16_t* low = leaf.low(axis);
  const uint8_t* high = leaf.high(axis);
  const uint32_t present = 0u - (leaf.header().flags >> axis & 1u), base = leaf.base(axis);
  const auto at = [&](uint32_t v) {
    return std::bit_cast<float>(base + low[v] + ((uint32_t{high[v]} & present) << 16));
  };
  return V4{lanes_set(at(vertex[0]), at(vertex[1]), at(vertex[2]))};
}

/// Sheared corners, a lane each.
struct ShearedCorners {
  V4 x, y, z;
};

/// The edge functions of c b, a c, b a and t, in double: TriangleTest::kWatertight.
HWY_INLINE bool cross_line_lanes(const RaySpace& ray, const ShearedCorners& at, TriangleHit& hit, hn::Vec<D4>& weights) {
  const F4 f;
  const D4 d;
  HWY_ALIGN static constexpr int32_t kEdgeFrom[4] = {2, 0, 1, 3}, kEdgeTo[4] = {1, 2, 0, 3};
  const auto cab = hn::SetTableIndices(f, kEdgeFrom), bca = hn::SetTableIndices(f, kEdgeTo);
  const auto from_x = hn::PromoteTo(d, hn::TableLookupLanes(at.x, cab));
  const auto from_y = hn::PromoteTo(d, hn::TableLookupLanes(at.y, cab));
  const auto to_x = hn::PromoteTo(d, hn::TableLookupLanes(at.x, bca));
  const auto to_y = hn::PromoteTo(d, hn::TableLookupLanes(at.y, bca));
  const auto edge = hn::Sub(hn::Mul(from_x, to_y), hn::Mul(from_y, to_x));
  const auto corner = hn::FirstN(d, 3);
  const auto none = hn::Zero(d);
  const double eu = hn::ExtractLane(edge, 0), ev = hn::ExtractLane(edge, 1), ew = hn::ExtractLane(edge, 2);
  const double det = eu + ev + ew;
  const bool negative = !hn::AllFalse(d, hn::And(corner, hn::Lt(edge, none)));
  const bool positive = !hn::AllFalse(d, hn::And(corner, hn::Gt(edge, none)));
  if ((negative & positive) | (det == 0)) return false;
  const double inverse = 1 / det;
  weights = hn::Mul(edge, hn::Set(d, inverse));
  const auto bz = hn::Mul(weights, hn::PromoteTo(d, at.z));
  const double sum = hn::ExtractLane(bz, 0) + hn::ExtractLane(bz, 1) + hn::ExtractLane(bz, 2);
  hit.t = static_cast<float>(sum / ray.direction[ray.kz]);
  return true;
}

/// The same in float: TriangleTest::kFast.
HWY_INLINE bool cross_line_lanes(const RaySpace& ray, const ShearedCorners& at, TriangleHit& hit, V4& weights) {
  const F4 f;
  HWY_ALIGN static constexpr int32_t kEdgeFrom[4] = {2, 0, 1, 3}, kEdgeTo[4] = {1, 2, 0, 3};
  const auto cab = hn::SetTableIndices(f, kEdgeFrom), bca = hn::SetTableIndices(f, kEdgeTo);
  const auto edge = hn::Sub(hn::Mul(hn::TableLookupLanes(at.x, cab), hn::TableLookupLanes(at.y, bca)),
                            hn::Mul(hn::TableLookupLanes(at.y, cab), hn::TableLookupLanes(at.x, bca)));
  const float eu = hn::ExtractLane(edge, 0), ev = hn::ExtractLane(edge, 1), ew = hn::ExtractLane(edge, 2);
  const float det = eu + ev + ew, size = std::abs(det);
  // Edges of both signs were left out with the whole leaf, by the same bits (float_edges_differ()).
  if (!(size >= std::numeric_limits<float>::min() && size <= std::numeric_limits<float>::max())) return false;
  weights = hn::Mul(edge, hn::Set(f, 1 / det));
  const auto bz = hn::Mul(weights, at.z);
  const float sum = hn::ExtractLane(bz, 0) + hn::ExtractLane(bz, 1) + hn::ExtractLane(bz, 2);
  hit.t = sum / ray.direction[ray.kz];
  return true;
}

/// `Weights`: the vector of their type, which says by which kind of test.
template <class Weights>
HWY_INLINE bool intersect_lanes(const RaySpace& ray, const V4 corners[3], float t_max, TriangleHit& hit) {
  const F4 f;
  HWY_ALIGN float words[3][4];
  for (int axis = 0; axis < 3; ++axis) hn::Store(corners[axis], f, words[axis]);
  const auto z = hn::Sub(hn::Load(f, words[ray.kz]), hn::Set(f, ray.origin[ray.kz]));
  const auto x = hn::Sub(hn::Sub(hn::Load(f, words[ray.kx]), hn::Set(f, ray.origin[ray.kx])),
                         hn::Mul(hn::Set(f, ray.shear_x), z));
  const auto y = hn::Sub(hn::Sub(hn::Load(f, words[ray.ky]), hn::Set(f, ray.origin[ray.ky])),
                         hn::Mul(hn::Set(f, ray.shear_y), z));
  Weights weights;
  if (!cross_line_lanes(ray, {x, y, z}, hit, weights)) return false;
  const BoxSpan span = triangle_test::cross_own_box(
      ray, lanes_set(words[0][0], words[1][0], words[2][0]), lanes_set(words[0][1], words[1][1], words[2][1]),
      lanes_set(words[0][2], words[1][2], words[2][2]));
  if (!span.entered(t_max)) return false;
  hit.t = std::min(std::max(hit.t, span.t_near), span.t_far);
  if (!(hit.t > 0 && hit.t <= t_max)) return false;
  hit.b1 = static_cast<float>(hn::ExtractLane(weights, 1));
  hit.b2 = static_cast<float>(hn::ExtractLane(weights, 2));
  return true;
}

template <class Weights>
HWY_INLINE bool intersect_corners(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max,
                                  TriangleHit& hit) {
  const uint32_t vertex[3] = {leaf.corner(0)[i], leaf.corner(1)[i], leaf.corner(2)[i]};
  const V4 corners[3] = {load_corners(leaf, 0, vertex), load_corners(leaf, 1, vertex), load_corners(leaf, 2, vertex)};
  return intersect_lanes<Weights>(ray, corners, t_max, hit);
}

/// intersect_triangle() of triangle `i`.
HWY_INLINE bool intersect_stored(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max, TriangleHit& hit) {
  return intersect_corners<hn::Vec<D4>>(ray, leaf, i, t_max, hit);
}

/// The same by TriangleTest::kFast. Requires: the triangle is one of find_candidates<TriangleTest::kFast>().
HWY_INLINE bool intersect_stored_fast(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max,
                                      TriangleHit& hit) {
  return intersect_corners<V4>(ray, leaf, i, t_max, hit);
}

#else

HWY_INLINE bool intersect_stored(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max, TriangleHit& hit) {
  return intersect_triangle(ray, leaf.position(i, 0), leaf.position(i, 1), leaf.position(i, 2), t_max, hit);
}

HWY_INLINE bool intersect_stored_fast(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max,
                                      TriangleHit& hit) {
  return intersect_triangle<TriangleTest::kFast>(ray, leaf.position(i, 0), leaf.position(i, 1), leaf.position(i, 2),
                                                 t_max, hit);
}

#endif

/// The same for any kind of test; TriangleTest::kDouble has no form in lanes. Requires: as intersect_stored_fast().
template <TriangleTest kTest>
HWY_INLINE bool intersect_stored_by(const RaySpace& ray, const LeafView& leaf, uint32_t i, float t_max,
                                    TriangleHit& hit) {
  if constexpr (kTest == TriangleTest::kWatertight) return intersect_stored(ray, leaf, i, t_max, hit);
  if constexpr (kTest == TriangleTest::kFast) return intersect_stored_fast(ray, leaf, i, t_max, hit);
  return intersect_triangle<kTest>(ray, leaf.position(i, 0), leaf.position(i, 1), leaf.position(i, 2), t_max, hit);
}

/// Tests those triangles of a leaf in turn, nearer hits taking the place of earlier ones; `id`: of the treelet. Returns true
/// when an any-hit ray is done. Requires: as intersect_stored_by().
template <TriangleTest kTest>
HWY_INLINE bool test_candidates(const TreeletView& treelet, const LeafView& leaf, uint32_t offset, uint32_t candidates,
                                const RaySpace& space, Ray& ray, TreeletId id, TraceCounters& counters) {
  for (; candidates != 0; candidates &= candidates - 1) {
    const auto i = static_cast<uint32_t>(std::countr_zero(candidates));
    TriangleHit hit;
    if (intersect_stored_by<kTest>(space, leaf, i, ray.t, hit) &&
        take_hit(treelet, leaf, offset, i, hit, ray, id, counters)) {
      return true;
    }
  }
  return false;
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
