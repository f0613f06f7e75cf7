// The kernels of the kinds of triangle test that are not the default, apart from it: so they cannot change how it is
// compiled. Called by trace_treelets() and LaneTracer. Thread rule and cost: theirs.
#pragma once

#include "treelets/scene_kernels.h"
#include "treelets/trace_treelet.h"

namespace shoal {

/// trace_treelets(), but for the sums of tests. Requires: not TriangleTest::kWatertight, as the next.
void trace_treelets_by(TriangleTest test, std::span<TraceJob> jobs, TraceCounters& counters);
/// LaneTracer::trace() by tables.test.
uint64_t trace_lanes_by(const SceneTables& tables, struct SceneLanes& lanes, uint64_t most, RayStream& stream,
                        TraceCounters& counters);

}  // namespace shoal
