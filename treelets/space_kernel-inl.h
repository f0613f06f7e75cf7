// A ray prepared for its own space by vectors: the bits of prepare_ray() and set_pad() (treelets/ray_space.h).
// Included once a target (foreach_target.h).
#if defined(SHOAL_TREELETS_SPACE_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_SPACE_KERNEL_INL_H
#undef SHOAL_TREELETS_SPACE_KERNEL_INL_H
#else
#define SHOAL_TREELETS_SPACE_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/ray_space.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// The space of an object whose space is the world.
HWY_INLINE void prepare_identity(const Ray& ray, float max_abs_coordinate, RaySpace& space) {
#if HWY_MAX_BYTES >= 16 && HWY_TARGET != HWY_SCALAR
  static_assert(offsetof(Ray, origin) == 0 && offsetof(Ray, direction) == 16);
  const hn::FixedTag<float, 4> f;
  const hn::RebindToUnsigned<decltype(f)> u;
  const auto xyz = hn::FirstN(f, 3);
  const float* words = &ray.origin.x;
  const auto origin = hn::IfThenElseZero(xyz, hn::Load(f, words));
  const auto direction = hn::IfThenElse(xyz, hn::Load(f, words + 4), hn::Set(f, 1.0f));
  const auto most_float = hn::Set(f, std::numeric_limits<float>::max());
  const auto inverse = hn::Min(hn::Max(hn::Div(hn::Set(f, 1.0f), direction), hn::Neg(most_float)), most_float);
  hn::Store(origin, f, space.origin);
  hn::Store(direction, f, space.direction);
  hn::Store(inverse, f, space.inverse);
  hn::Store(hn::ShiftRight<31>(hn::BitCast(u, direction)), u, space.negative);
  set_axes(ray.direction, space);

  const float reach = max_abs(&ray.origin.x) + max_abs_coordinate;
  space.pad = object_pad(space, max_abs_coordinate);
  const float least = std::abs(space.inverse[space.kz]);
  const auto most = hn::Set(f, least * kMaxSlope);
  const auto slope = hn::Min(hn::Max(inverse, hn::Neg(most)), most);
  const auto toward = hn::CopySign(hn::Set(f, space.pad + kNodePad * reach), direction);
  hn::Store(slope, f, space.slope);
  hn::Store(hn::Neg(hn::Mul(hn::Sub(origin, toward), slope)), f, space.far_bias);
  hn::Store(hn::Neg(hn::Mul(hn::Add(origin, toward), slope)), f, space.near_bias);
  const float largest = max_abs(space.slope);
  space.extreme = is_extreme(largest, least, reach);
#else
  space = prepare_ray(ray.origin, ray.direction);
  set_pad(space, object_pad(space, max_abs_coordinate), max_abs(space.origin) + max_abs_coordinate);
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
