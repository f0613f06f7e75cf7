#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_treelet.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

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
  const float step[3] = {power_of_two(node.exponent[0]), power_of_two(node.exponent[1]),
                         power_of_two(node.exponent[2])};
  const auto plane = [&](uint32_t side, uint32_t axis, size_t first) HWY_ATTR {
    const uint8_t* q = (side ? node.hi : node.lo)[axis] + first;
    const auto grid = hn::ConvertTo(F8(), hn::PromoteTo(I8(), hn::LoadU(B8(), q)));
    return hn::Add(hn::Set(F8(), node.origin[axis]), hn::Mul(grid, hn::Set(F8(), step[axis])));
  };
  return cross_boxes(ray, t, plane, keys) & ((1u << node.child_count) - 1);
}

/// The triangles of a leaf that the exact test may accept: all but those with edge functions of certainly different
/// signs, by the float arithmetic of triangle_test.h.
HWY_INLINE uint32_t find_candidates(const RaySpace& ray, const LeafView& leaf) {
  const F8 f;
  const I8 di;
  const uint32_t count = leaf.header->triangle_count;
  const float* px = leaf.axis[ray.kx];
  const float* py = leaf.axis[ray.ky];
  const float* pz = leaf.axis[ray.kz];
  const auto last_vertex = hn::Set(di, static_cast<int32_t>(leaf.header->vertex_count) - 1);
  uint32_t mask = 0;
  for (size_t first = 0; first < count; first += hn::Lanes(f)) {
    struct Corner {
      hn::Vec<F8> x, y;
    } corner[3];
    for (int k = 0; k < 3; ++k) {
      // Lanes past the last triangle hold other bytes: kept inside the leaf, their result is dropped.
      const auto index = hn::Min(hn::PromoteTo(di, hn::LoadU(B8(), leaf.corner[k] + first)), last_vertex);
      const auto z = hn::Sub(hn::GatherIndex(f, pz, index), hn::Set(f, ray.origin[ray.kz]));
      corner[k].x = hn::Sub(hn::Sub(hn::GatherIndex(f, px, index), hn::Set(f, ray.origin[ray.kx])),
                            hn::Mul(hn::Set(f, ray.shear_x), z));
      corner[k].y = hn::Sub(hn::Sub(hn::GatherIndex(f, py, index), hn::Set(f, ray.origin[ray.ky])),
                            hn::Mul(hn::Set(f, ray.shear_y), z));
    }
    auto positive = hn::Lt(hn::Zero(f), hn::Zero(f)), negative = positive;
    const int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
    for (int e = 0; e < 3; ++e) {
      const auto p1 = hn::Mul(corner[from[e]].x, corner[to[e]].y);
      const auto p2 = hn::Mul(corner[from[e]].y, corner[to[e]].x);
      const auto value = hn::Sub(p1, p2);
      const auto bound = hn::Add(hn::Mul(hn::Set(f, kEdgeError), hn::Add(hn::Abs(p1), hn::Abs(p2))),
                                 hn::Set(f, kEdgeUnderflow));
      positive = hn::Or(positive, hn::Gt(value, bound));
      negative = hn::Or(negative, hn::Lt(value, hn::Neg(bound)));
    }
    uint8_t bits[8] = {};
    hn::StoreMaskBits(f, hn::And(positive, negative), bits);
    mask |= uint32_t{bits[0]} << first;
  }
  return ~mask & ((1u << count) - 1);
}

void trace(const TreeletView& treelet, const TreeletEntry& entry, const RaySpace& space, Ray& ray,
           TraceCounters& counters) {
  TraversalStack stack;
  NodeRef ref = entry.root;
  do {
    if (is_leaf(ref)) {
      const LeafView leaf = treelet.leaf(leaf_offset(ref));
      counters.triangle_tests_count += leaf.header->triangle_count;
      for (uint32_t mask = find_candidates(space, leaf); mask != 0; mask &= mask - 1) {
        const uint32_t i = static_cast<uint32_t>(std::countr_zero(mask));
        if (test_triangle(treelet, leaf, leaf_offset(ref), i, space, entry, ray, counters)) return;
      }
    } else {
      ++counters.node_tests_count;
      const QuantizedNode& node = treelet.nodes[ref];
      uint32_t keys[8];
      stack.push(keys, node.child, cross_node(space, node, ray.t, keys));
    }
  } while (stack.pop(ray.t, ref));
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
