// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_treelets.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/inner_loops.h"
#include "treelets/trace_other_kinds.h"
#include "treelets/trace_touching.h"
#include "treelets/treelet_tracer-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

void trace(std::span<TraceJob> jobs, TraceCounters& counters) {
  Tracer<TriangleTest::kWatertight>(jobs, counters).run();
}

void trace_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchLog& log) {
  Tracer<TriangleTest::kWatertight, TouchMeter>(jobs, counters, {&log}).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(trace);
HWY_EXPORT(trace_touching);

namespace {

void add_tests(std::span<const TraceJob> jobs, TraceCounters& counters) {
  for (const TraceJob& job : jobs) {
    counters.node_tests_count += job.node_tests;
    counters.triangle_tests_count += job.triangle_tests;
  }
}

}  // namespace

void trace_treelets(std::span<TraceJob> jobs, TraceCounters& counters, TriangleTest test, InnerLoop loop) {
  if (HWY_UNLIKELY(loop != InnerLoop::kMoreNumerous)) {
    trace_lock_step(jobs, counters, test, loop);
  } else if (HWY_LIKELY(test == TriangleTest::kWatertight)) {
    HWY_DYNAMIC_DISPATCH(trace)(jobs, counters);
  } else {
    trace_treelets_by(test, jobs, counters);
  }
  add_tests(jobs, counters);
}

void trace_treelets_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchLog& log, InnerLoop loop) {
  if (loop != InnerLoop::kMoreNumerous) {
    trace_lock_step_touching(jobs, counters, loop, log);
  } else {
    HWY_DYNAMIC_DISPATCH(trace_touching)(jobs, counters, log);
  }
  add_tests(jobs, counters);
}

void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   RayContext& context, TraceCounters& counters, TriangleTest test) {
  TraceJob job{page.data(), &ray, &context, &instance, entry};
  trace_treelets({&job, 1}, counters, test);
}

void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   TraceCounters& counters, TriangleTest test) {
  RayContext context;
  trace_treelet(page, entry, instance, ray, context, counters, test);
}

}  // namespace shoal
#endif
