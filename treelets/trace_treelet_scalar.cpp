#include "treelets/trace_treelet_scalar.h"

#include "treelets/leaf_test.h"
#include "treelets/traversal_stack.h"

namespace shoal {
namespace {

uint32_t cross_node(const RaySpace& space, const QuantizedNode& node, float t, uint32_t keys[8]) {
  uint32_t mask = 0;
  float step[3];
  for (int axis = 0; axis < 3; ++axis) step[axis] = power_of_two(node.exponent[axis]);
  for (uint32_t slot = 0; slot < node.child_count; ++slot) {
    float lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = dequantize(node.origin[axis], step[axis], node.lo[axis][slot]);
      hi[axis] = dequantize(node.origin[axis], step[axis], node.hi[axis][slot]);
    }
    const BoxSpan span = cross_box(space, lo, hi);
    keys[slot] = entry_key(span.t_near, slot);
    if (span.entered(t)) mask |= 1u << slot;
  }
  return mask;
}

template <TriangleTest kTest>
void trace_job(TraceJob& job, TraceCounters& counters) {
  const TreeletView treelet(job.page);
  const Ray& ray = *job.ray;
  const RaySpace& space = job.context->object_space(ray, *job.instance);
  TraversalStack stack;
  NodeRef ref = job.entry.root;
  do {
    while (!is_leaf(ref)) {
      ++job.node_tests;
      const QuantizedNode& node = treelet.nodes[ref];
      uint32_t keys[8];
      const uint32_t mask = cross_node(space, node, ray.t, keys);
      if (!stack.enter(keys, node.child, mask, ref) && !stack.pop(ray.t, ref)) return;
    }
    const LeafView leaf = treelet.leaf(leaf_offset(ref));
    job.triangle_tests += leaf.triangle_count;
    for (uint32_t i = 0; i < leaf.triangle_count; ++i) {
      if (test_triangle<kTest>(treelet, leaf, leaf_offset(ref), i, space, job, counters)) return;
    }
  } while (stack.pop(ray.t, ref));
}

}  // namespace

void trace_treelet_scalar(TraceJob& job, TraceCounters& counters, TriangleTest test) {
  if (test == TriangleTest::kFast) return trace_job<TriangleTest::kFast>(job, counters);
  if (test == TriangleTest::kDouble) return trace_job<TriangleTest::kDouble>(job, counters);
  trace_job<TriangleTest::kWatertight>(job, counters);
}

void trace_treelet_scalar(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance,
                          Ray& ray, TraceCounters& counters, TriangleTest test) {
  RayContext context;
  TraceJob job{page.data(), &ray, &context, &instance, entry};
  trace_treelet_scalar(job, counters, test);
  counters.node_tests_count += job.node_tests;
  counters.triangle_tests_count += job.triangle_tests;
}

}  // namespace shoal
