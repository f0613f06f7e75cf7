// The traversal of a treelet in plain scalar C++: the reference that the SIMD kernel is compared with, bit for bit.
// Called by tests.
#pragma once

#include "treelets/ray_space.h"
#include "treelets/trace_treelet.h"

namespace shoal {

/// As trace_treelet().
void trace_treelet_scalar(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance,
                          Ray& ray, TraceCounters& counters);

}  // namespace shoal
