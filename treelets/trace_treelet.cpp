// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_treelet.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include <hwy/cache_control.h>

#include "treelets/box_kernel-inl.h"
#include "treelets/leaf_test.h"
#include "treelets/trace_treelet.h"
#include "treelets/traversal_stack.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

using I8 = hn::RebindToSigned<F8>;
using B8 = hn::Rebind<uint8_t, F8>;

HWY_INLINE uint32_t cross_node(const RaySpace& ray, const QuantizedNode& node, float t, uint32_t keys[8]) {
  static_assert(offsetof(QuantizedNode, hi) == offsetof(QuantizedNode, lo) + 24);
  const uint8_t* planes = reinterpret_cast<const uint8_t*>(&node) + offsetof(QuantizedNode, lo);
  const float step[3] = {power_of_two(node.exponent[0]), power_of_two(node.exponent[1]),
                         power_of_two(node.exponent[2])};
  const auto plane = [&](uint32_t side, uint32_t axis, size_t first) HWY_ATTR {
    const uint8_t* q = planes + 24 * size_t{side} + 8 * axis + first;
    const auto grid = hn::ConvertTo(F8(), hn::PromoteTo(I8(), hn::LoadU(B8(), q)));
    return hn::Add(hn::Set(F8(), node.origin[axis]), hn::Mul(grid, hn::Set(F8(), step[axis])));
  };
  return cross_boxes(ray, t, plane, keys) & ((1u << node.child_count) - 1);
}

template <class V>
struct ShearedVec {
  V x, y;
};

/// A vertex array of the leaf, from `first` on, translated and sheared: shear() of triangle_test.h.
template <class D>
HWY_INLINE ShearedVec<hn::Vec<D>> shear_vertices(D d, const RaySpace& ray, const LeafView& leaf, size_t first) {
  const auto x = hn::LoadU(d, leaf.axis(ray.kx) + first), y = hn::LoadU(d, leaf.axis(ray.ky) + first);
  const auto z = hn::Sub(hn::LoadU(d, leaf.axis(ray.kz) + first), hn::Set(d, ray.origin[ray.kz]));
  return {hn::Sub(hn::Sub(x, hn::Set(d, ray.origin[ray.kx])), hn::Mul(hn::Set(d, ray.shear_x), z)),
          hn::Sub(hn::Sub(y, hn::Set(d, ray.origin[ray.ky])), hn::Mul(hn::Set(d, ray.shear_y), z))};
}

#if HWY_MAX_BYTES >= 32
HWY_INLINE hn::Vec<F8> lower_eight(hn::Vec<hn::CappedTag<float, 16>> v) {
#if HWY_MAX_BYTES >= 64
  return hn::LowerHalf(F8(), v);
#else
  return v;
#endif
}

/// The sheared corners of the leaf's triangles, a lane a triangle: vertices are sheared once and then looked up in
/// registers. Lanes past the last triangle hold anything.
HWY_INLINE void gather_corners(const RaySpace& ray, const LeafView& leaf, size_t,
                               ShearedVec<hn::Vec<F8>> corner[3]) {
  const hn::CappedTag<float, 16> d;
  const hn::RebindToSigned<decltype(d)> di;
  constexpr size_t kLanes = HWY_MAX_BYTES >= 64 ? 16 : 8;
  ShearedVec<hn::Vec<decltype(d)>> table = shear_vertices(d, ray, leaf, 0);
  hn::Vec<decltype(di)> index[3];
  ShearedVec<hn::Vec<decltype(d)>> found[3];
  for (uint32_t k = 0; k < 3; ++k) {
    index[k] = hn::PromoteTo(di, hn::LoadU(hn::Rebind<uint8_t, decltype(d)>(), leaf.corner(k)));
    const auto lanes = hn::IndicesFromVec(d, hn::And(index[k], hn::Set(di, int32_t{kLanes - 1})));
    found[k] = {hn::TableLookupLanes(table.x, lanes), hn::TableLookupLanes(table.y, lanes)};
  }
  for (size_t first = kLanes; first < leaf.vertex_count; first += kLanes) {
    table = shear_vertices(d, ray, leaf, first);
    for (uint32_t k = 0; k < 3; ++k) {
      const auto lanes = hn::IndicesFromVec(d, hn::And(index[k], hn::Set(di, int32_t{kLanes - 1})));
      const auto here = hn::RebindMask(d, hn::Gt(index[k], hn::Set(di, static_cast<int32_t>(first) - 1)));
      found[k] = {hn::IfThenElse(here, hn::TableLookupLanes(table.x, lanes), found[k].x),
                  hn::IfThenElse(here, hn::TableLookupLanes(table.y, lanes), found[k].y)};
    }
  }
  for (int k = 0; k < 3; ++k) corner[k] = {lower_eight(found[k].x), lower_eight(found[k].y)};
}
#else
/// The same with gathers from memory, for triangles from `first` on.
HWY_INLINE void gather_corners(const RaySpace& ray, const LeafView& leaf, size_t first,
                               ShearedVec<hn::Vec<F8>> corner[3]) {
  const F8 f;
  const I8 di;
  const auto last_vertex = hn::Set(di, static_cast<int32_t>(leaf.vertex_count) - 1);
  for (uint32_t k = 0; k < 3; ++k) {
    // Lanes past the last triangle hold other bytes: kept inside the leaf, their result is dropped.
    const auto index = hn::Min(hn::PromoteTo(di, hn::LoadU(B8(), leaf.corner(k) + first)), last_vertex);
    const auto z = hn::Sub(hn::GatherIndex(f, leaf.axis(ray.kz), index), hn::Set(f, ray.origin[ray.kz]));
    corner[k].x = hn::Sub(hn::Sub(hn::GatherIndex(f, leaf.axis(ray.kx), index), hn::Set(f, ray.origin[ray.kx])),
                          hn::Mul(hn::Set(f, ray.shear_x), z));
    corner[k].y = hn::Sub(hn::Sub(hn::GatherIndex(f, leaf.axis(ray.ky), index), hn::Set(f, ray.origin[ray.ky])),
                          hn::Mul(hn::Set(f, ray.shear_y), z));
  }
}
#endif

/// The triangles of a leaf that the exact test may accept: all but those with edge functions of certainly different
/// signs, by the float arithmetic of triangle_test.h.
HWY_INLINE uint32_t find_candidates(const RaySpace& ray, const LeafView& leaf) {
  const F8 f;
  uint32_t mask = 0;
  for (size_t first = 0; first < leaf.triangle_count; first += hn::Lanes(f)) {
    ShearedVec<hn::Vec<F8>> corner[3];
    gather_corners(ray, leaf, first, corner);
    auto positive = hn::Lt(hn::Zero(f), hn::Zero(f)), negative = positive;
    const int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
    for (int e = 0; e < 3; ++e) {
      const auto p1 = hn::Mul(corner[from[e]].x, corner[to[e]].y);
      const auto p2 = hn::Mul(corner[from[e]].y, corner[to[e]].x);
      const auto value = hn::Sub(p1, p2);
      const auto bound =
          hn::Add(hn::Mul(hn::Set(f, kEdgeError), hn::Add(hn::Abs(p1), hn::Abs(p2))), hn::Set(f, kEdgeUnderflow));
      positive = hn::Or(positive, hn::Gt(value, bound));
      negative = hn::Or(negative, hn::Lt(value, hn::Neg(bound)));
    }
    uint8_t bits[8] = {};
    hn::StoreMaskBits(f, hn::And(positive, negative), bits);
    mask |= uint32_t{bits[0]} << first;
  }
  return ~mask & ((1u << leaf.triangle_count) - 1);
}

void trace(const TreeletView& treelet, const TreeletEntry& entry, const RaySpace& space, Ray& ray,
           TraceCounters& counters) {
  const std::byte* leaves = treelet.page + treelet.header->leaves_offset;
  // Asks for the lines of what waits (of a leaf of 8 triangles that share nothing: 5), so that misses overlap.
  const auto prefetch = [&](NodeRef ref) {
    const std::byte* at = is_leaf(ref) ? leaves + size_t{4} * leaf_offset(ref)
                                       : reinterpret_cast<const std::byte*>(treelet.nodes + ref);
    for (int line = 0; line < (is_leaf(ref) ? 5 : 2); ++line) hwy::Prefetch(at + 64 * line);
  };
  uint64_t node_tests = 0, triangle_tests = 0;
  TraversalStack stack;
  NodeRef ref = entry.root;
  bool going_on = true;
  while (going_on) {
    if (!is_leaf(ref)) {
      ++node_tests;
      const QuantizedNode& node = treelet.nodes[ref];
      uint32_t keys[8];
      const uint32_t mask = cross_node(space, node, ray.t, keys);
      going_on = stack.enter(keys, node.child, mask, ref, prefetch) || stack.pop(ray.t, ref);
      continue;
    }
    const LeafView leaf(leaves + size_t{4} * leaf_offset(ref));
    triangle_tests += leaf.triangle_count;
    bool done = false;
    for (uint32_t mask = find_candidates(space, leaf); mask != 0 && !done; mask &= mask - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(mask));
      done = test_triangle(treelet, leaf, leaf_offset(ref), i, space, entry, ray, counters);
    }
    going_on = !done && stack.pop(ray.t, ref);
  }
  counters.node_tests_count += node_tests;
  counters.triangle_tests_count += triangle_tests;
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(trace);

void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   RayContext& context, TraceCounters& counters) {
  HWY_DYNAMIC_DISPATCH(trace)(TreeletView(page), entry, context.object_space(ray, instance), ray, counters);
}

void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   TraceCounters& counters) {
  RayContext context;
  trace_treelet(page, entry, instance, ray, context, counters);
}

}  // namespace shoal
#endif
