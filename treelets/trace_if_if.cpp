// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_if_if.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/inner_loops.h"
#include "treelets/treelet_tracer-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

template <TriangleTest kTest>
class IfIf : private Tracer<kTest> {
  using Tracer<kTest>::kNodes, Tracer<kTest>::kLeaves, Tracer<kTest>::waiting_, Tracer<kTest>::counters_;

 public:
  using Tracer<kTest>::Tracer;

  HWY_INLINE void run() {
    for (uint32_t lane = 0; lane < kTraceLanes; ++lane) this->start(lane);
    while (waiting_[kNodes].size() + waiting_[kLeaves].size() > 0) {
      if (waiting_[kNodes].size() > 0) {
        count(kNodes);
        this->cross_nodes();
      }
      if (waiting_[kLeaves].size() > 0) {
        count(kLeaves);
        this->cross_leaves();
      }
    }
  }

 private:
  HWY_INLINE void count(uint32_t kind) {
    counters_.simd_lanes_count += kTraceLanes;
    counters_.simd_active_lanes_count += waiting_[kind].size();
  }
};

void if_if_watertight(std::span<TraceJob> jobs, TraceCounters& counters) {
  IfIf<TriangleTest::kWatertight>(jobs, counters).run();
}
void if_if_fast(std::span<TraceJob> jobs, TraceCounters& counters) {
  IfIf<TriangleTest::kFast>(jobs, counters).run();
}
void if_if_double(std::span<TraceJob> jobs, TraceCounters& counters) {
  IfIf<TriangleTest::kDouble>(jobs, counters).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(if_if_watertight);
HWY_EXPORT(if_if_fast);
HWY_EXPORT(if_if_double);

void trace_if_if(std::span<TraceJob> jobs, TraceCounters& counters, TriangleTest test) {
  switch (test) {
    case TriangleTest::kFast:
      return HWY_DYNAMIC_DISPATCH(if_if_fast)(jobs, counters);
    case TriangleTest::kDouble:
      return HWY_DYNAMIC_DISPATCH(if_if_double)(jobs, counters);
    case TriangleTest::kWatertight:
      return HWY_DYNAMIC_DISPATCH(if_if_watertight)(jobs, counters);
  }
}

}  // namespace shoal
#endif
