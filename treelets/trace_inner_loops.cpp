// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_inner_loops.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/inner_loops.h"
#include "treelets/treelet_tracer-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

template <TriangleTest kTest, class Meter = NoTouches>
class LockStep : private Tracer<kTest, Meter> {
  using Base = Tracer<kTest, Meter>;
  using Base::kNodes, Base::kLeaves, Base::waiting_, Base::counters_;

 public:
  using Base::Base;

  HWY_INLINE void while_while() {
    for (start(); nodes() + leaves() > 0;) {
      while (nodes() > 0) step_nodes();
      if (leaves() > 0) step_leaves();
    }
  }

  HWY_INLINE void if_if() {
    for (start(); nodes() + leaves() > 0;) {
      if (nodes() > 0) step_nodes();
      if (leaves() > 0) step_leaves();
    }
  }

 private:
  HWY_INLINE void start() {
    for (uint32_t lane = 0; lane < kTraceLanes; ++lane) Base::start(lane);
  }
  HWY_INLINE uint32_t nodes() const { return waiting_[kNodes].size(); }
  HWY_INLINE uint32_t leaves() const { return waiting_[kLeaves].size(); }
  HWY_INLINE void step_nodes() {
    count(nodes());
    this->cross_nodes();
  }
  HWY_INLINE void step_leaves() {
    count(leaves());
    this->cross_leaves();
  }
  HWY_INLINE void count(uint32_t active) {
    counters_.simd_lanes_count += kTraceLanes;
    counters_.simd_active_lanes_count += active;
  }
};

template <TriangleTest kTest, class Meter = NoTouches>
HWY_INLINE void run_lock_step(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop, Meter meter = {}) {
  LockStep<kTest, Meter> lanes(jobs, counters, meter);
  loop == InnerLoop::kWhileWhile ? lanes.while_while() : lanes.if_if();
}

void lock_step_watertight(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop) {
  run_lock_step<TriangleTest::kWatertight>(jobs, counters, loop);
}
void lock_step_fast(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop) {
  run_lock_step<TriangleTest::kFast>(jobs, counters, loop);
}
void lock_step_double(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop) {
  run_lock_step<TriangleTest::kDouble>(jobs, counters, loop);
}
void lock_step_touching(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop, TouchLog& log) {
  run_lock_step<TriangleTest::kWatertight>(jobs, counters, loop, TouchMeter{&log});
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(lock_step_watertight);
HWY_EXPORT(lock_step_fast);
HWY_EXPORT(lock_step_double);
HWY_EXPORT(lock_step_touching);

void trace_lock_step(std::span<TraceJob> jobs, TraceCounters& counters, TriangleTest test, InnerLoop loop) {
  switch (test) {
    case TriangleTest::kFast:
      return HWY_DYNAMIC_DISPATCH(lock_step_fast)(jobs, counters, loop);
    case TriangleTest::kDouble:
      return HWY_DYNAMIC_DISPATCH(lock_step_double)(jobs, counters, loop);
    case TriangleTest::kWatertight:
      return HWY_DYNAMIC_DISPATCH(lock_step_watertight)(jobs, counters, loop);
  }
}

void trace_lock_step_touching(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop, TouchLog& log) {
  HWY_DYNAMIC_DISPATCH(lock_step_touching)(jobs, counters, loop, log);
}

}  // namespace shoal
#endif
