// The traversal of a treelet in plain scalar C++, every node by box_test.h: the reference that the SIMD kernel is
// compared with, bit for bit, and the way of rays whose numbers are too extreme for it (RaySpace::extreme).
#pragma once

#include "treelets/ray_space.h"
#include "treelets/trace_treelet.h"

namespace shoal {

/// One job of trace_treelets(); its tests are counted in the job only.
void trace_treelet_scalar(TraceJob& job, TraceCounters& counters, TriangleTest test = TriangleTest::kWatertight);
/// As trace_treelet().
void trace_treelet_scalar(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance,
                          Ray& ray, TraceCounters& counters, TriangleTest test = TriangleTest::kWatertight);

}  // namespace shoal
