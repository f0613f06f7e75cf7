// Boxes against rows of rays, and against the interval that bounds all rays of a frame. Included once a target
// (foreach_target.h).
#if defined(SHOAL_TREELETS_ROW_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_ROW_KERNEL_INL_H
#undef SHOAL_TREELETS_ROW_KERNEL_INL_H
#else
#define SHOAL_TREELETS_ROW_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/child_boxes-inl.h"
#include "treelets/packet_rows.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using R16 = hn::CappedTag<float, kRowRays>;

/// Lanes of the row whose rays enter the box at or before their end: the test of cross_boxes() (box_kernel-inl.h),
/// each ray by the signs of its own direction.
HWY_INLINE uint32_t enter_box(const PacketRow& row, const WaitingBox& box) {
  const R16 f;
  uint32_t entered = 0;
  for (size_t first = 0; first < kRowRays; first += hn::Lanes(f)) {
    hn::Vec<R16> near[3], far[3];
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const auto slope = hn::Load(f, row.slope[axis] + first);
      const auto lo = hn::Set(f, box.lo[axis]), hi = hn::Set(f, box.hi[axis]);
      const auto negative =
          hn::Lt(slope, hn::Zero(f));  // never zero; IfNegativeThenElse of Highway 1.0.3 errs on SSSE3
      near[axis] = hn::MulAdd(hn::IfThenElse(negative, hi, lo), slope, hn::Load(f, row.near_bias[axis] + first));
      far[axis] = hn::MulAdd(hn::IfThenElse(negative, lo, hi), slope, hn::Load(f, row.far_bias[axis] + first));
    }
    const auto t_near = hn::Max(hn::Max(near[1], near[0]), hn::Max(near[2], hn::Zero(f)));
    const auto t_far = hn::Mul(hn::Min(far[2], hn::Min(far[1], far[0])), hn::Set(f, kFarScale));
    uint8_t bits[8] = {};
    hn::StoreMaskBits(f, hn::Le(t_near, hn::Min(t_far, hn::Load(f, row.t + first))), bits);
    entered |= (uint32_t{bits[0]} | uint32_t{bits[1]} << 8) << first;
  }
  return entered;
}

/// Interval arithmetic (Wald, Boulos & Shirley 2007, "Ray Tracing Deformable Scenes", 4.2; for slabs Boulos et al.
/// 2006): t of a plane is (plane - origin) * slope, so that over all rays it lies between the least and the
/// greatest of the four products of bounds. Returns the children, a bit each, that some ray of the frame may enter.
///
/// What enters a triangle's own box is accepted. In positions and units of u (ray_space.h): of |o| 3 for the moved
/// origin, which is got back as bias / slope, and 2 for the difference and the product, of B these 2 and 2 for the
/// plane, the enlargement 1; with the 4 and 3 of the triangle's box 10 and 8, and kNodePad is 12.
HWY_INLINE uint32_t may_enter(const PacketFrame& frame, const ChildBoxes& boxes) {
  const F8 f;
  uint32_t entered = 0;
  for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
    auto t_near = hn::Zero(f), t_far = hn::Set(f, std::numeric_limits<float>::max());
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const AxisInterval& at = frame.axis[axis];
      if (at.mixed) continue;
      const auto lo = hn::Load(f, boxes.lo[axis] + first), hi = hn::Load(f, boxes.hi[axis] + first);
      const auto near = at.negative ? hi : lo, far = at.negative ? lo : hi;
      const auto slope_0 = hn::Set(f, at.slope[0]), slope_1 = hn::Set(f, at.slope[1]);
      const auto a = hn::Sub(near, hn::Set(f, at.near_origin[1])), b = hn::Sub(near, hn::Set(f, at.near_origin[0]));
      const auto c = hn::Sub(far, hn::Set(f, at.far_origin[1])), d = hn::Sub(far, hn::Set(f, at.far_origin[0]));
      t_near = hn::Max(t_near, hn::Min(hn::Min(hn::Mul(a, slope_0), hn::Mul(a, slope_1)),
                                       hn::Min(hn::Mul(b, slope_0), hn::Mul(b, slope_1))));
      t_far = hn::Min(t_far, hn::Max(hn::Max(hn::Mul(c, slope_0), hn::Mul(c, slope_1)),
                                     hn::Max(hn::Mul(d, slope_0), hn::Mul(d, slope_1))));
    }
    t_far = hn::Mul(t_far, hn::Set(f, kFarScale));
    uint8_t bits[8] = {};
    hn::StoreMaskBits(f, hn::Le(t_near, hn::Min(t_far, hn::Set(f, frame.t))), bits);
    entered |= uint32_t{bits[0]} << first;
  }
  return entered;
}

/// Where the ray in a lane meets the boxes of the children, whether it enters them or not: the order in which the
/// packet visits them. Writes 8.
HWY_INLINE void near_of(const PacketRow& row, uint32_t lane, const ChildBoxes& boxes, float* near) {
  const F8 f;
  for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
    auto t_near = hn::Zero(f);
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const float slope = row.slope[axis][lane];
      const float* plane = (std::signbit(slope) ? boxes.hi : boxes.lo)[axis] + first;
      t_near =
          hn::Max(t_near, hn::MulAdd(hn::Load(f, plane), hn::Set(f, slope), hn::Set(f, row.near_bias[axis][lane])));
    }
    hn::StoreU(t_near, f, near + first);
  }
}

/// Sets the bounds of all rays of a frame. Lanes without a ray must hold the numbers of one.
HWY_INLINE void bound_rays(PacketFrame& frame, const PacketRow* rows) {
  const R16 f;
  HWY_ALIGN float least[kRowRays], most[kRowRays];
  const auto bounds = [&](auto&& values, float out[2]) HWY_ATTR {
    auto lo = values(rows[0], 0), hi = lo;
    for (uint32_t r = 0; r < frame.row_count; ++r) {
      for (size_t first = 0; first < kRowRays; first += hn::Lanes(f)) {
        const auto value = values(rows[r], first);
        lo = hn::Min(lo, value), hi = hn::Max(hi, value);
      }
    }
    hn::Store(lo, f, least), hn::Store(hi, f, most);
    out[0] = *std::min_element(least, least + hn::Lanes(f)), out[1] = *std::max_element(most, most + hn::Lanes(f));
  };
  for (uint32_t axis = 0; axis < 3; ++axis) {
    AxisInterval& at = frame.axis[axis];
    bounds([&](const PacketRow& row, size_t i) HWY_ATTR { return hn::Load(f, row.slope[axis] + i); }, at.slope);
    at.negative = std::signbit(at.slope[0]);
    at.mixed = at.negative != std::signbit(at.slope[1]);
    if (at.mixed) continue;
    const auto origin = [&](const float(*bias)[kRowRays], const PacketRow& row, size_t i) HWY_ATTR {
      return hn::Neg(hn::Div(hn::Load(f, bias[axis] + i), hn::Load(f, row.slope[axis] + i)));
    };
    bounds([&](const PacketRow& row, size_t i) HWY_ATTR { return origin(row.near_bias, row, i); }, at.near_origin);
    bounds([&](const PacketRow& row, size_t i) HWY_ATTR { return origin(row.far_bias, row, i); }, at.far_origin);
  }
  float t[2];
  bounds([&](const PacketRow& row, size_t i) HWY_ATTR { return hn::Load(f, row.t + i); }, t);
  frame.t = t[1];
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
