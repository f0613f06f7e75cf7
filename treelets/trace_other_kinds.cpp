// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_other_kinds.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/stream_tracer-inl.h"
#include "treelets/trace_other_kinds.h"
#include "treelets/treelet_tracer-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

void trace_fast(std::span<TraceJob> jobs, TraceCounters& counters) {
  Tracer<TriangleTest::kFast>(jobs, counters).run();
}
void trace_double(std::span<TraceJob> jobs, TraceCounters& counters) {
  Tracer<TriangleTest::kDouble>(jobs, counters).run();
}
uint64_t trace_lanes_fast(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
                          TraceCounters& counters) {
  return StreamTracer<TriangleTest::kFast>(tables, lanes, most, stream, counters).run();
}
uint64_t trace_lanes_double(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
                            TraceCounters& counters) {
  return StreamTracer<TriangleTest::kDouble>(tables, lanes, most, stream, counters).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(trace_fast);
HWY_EXPORT(trace_double);
HWY_EXPORT(trace_lanes_fast);
HWY_EXPORT(trace_lanes_double);

void trace_treelets_by(TriangleTest test, std::span<TraceJob> jobs, TraceCounters& counters) {
  if (test == TriangleTest::kFast) {
    HWY_DYNAMIC_DISPATCH(trace_fast)(jobs, counters);
  } else {
    HWY_DYNAMIC_DISPATCH(trace_double)(jobs, counters);
  }
}

uint64_t trace_lanes_by(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
                        TraceCounters& counters) {
  if (tables.test == TriangleTest::kFast) {
    return HWY_DYNAMIC_DISPATCH(trace_lanes_fast)(tables, lanes, most, stream, counters);
  }
  return HWY_DYNAMIC_DISPATCH(trace_lanes_double)(tables, lanes, most, stream, counters);
}

}  // namespace shoal
#endif
