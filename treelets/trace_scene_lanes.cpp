// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_scene_lanes.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/stream_tracer-inl.h"
#include "treelets/trace_other_kinds.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

uint64_t trace_lanes(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
                     TraceCounters& counters) {
  return StreamTracer<TriangleTest::kWatertight>(tables, lanes, most, stream, counters).run();
}

uint64_t trace_lanes_touching(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
                              TraceCounters& counters, TouchLog& touches) {
  return StreamTracer<TriangleTest::kWatertight, TouchMeter>(tables, lanes, most, stream, counters, {&touches}).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(trace_lanes);
HWY_EXPORT(trace_lanes_touching);

LaneTracer::LaneTracer() : lanes(std::make_unique<SceneLanes>()) {}
LaneTracer::~LaneTracer() = default;
uint64_t LaneTracer::bytes() { return sizeof(LaneTracer) + sizeof(SceneLanes); }

uint64_t LaneTracer::trace(const SceneTables& tables, uint64_t most, RayStream& stream, TraceCounters& counters,
                           TouchLog* touches) {
  if (HWY_UNLIKELY(tables.test != TriangleTest::kWatertight)) {
    return trace_lanes_by(tables, *lanes, most, stream, counters);
  }
  if (HWY_UNLIKELY(touches != nullptr)) {
    return HWY_DYNAMIC_DISPATCH(trace_lanes_touching)(tables, *lanes, most, stream, counters, *touches);
  }
  return HWY_DYNAMIC_DISPATCH(trace_lanes)(tables, *lanes, most, stream, counters);
}

}  // namespace shoal
#endif
