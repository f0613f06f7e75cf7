// The two loops of Aila & Laine 2009 ("Understanding the Efficiency of Ray Traversal on GPUs"), by which programs
// that run one ray a lane in lock-step trace: here kTraceLanes rays, each step of a lane the same kernel as ever. A
// lane that has nothing to do in a step stands idle, and is counted (TraceCounters::simd_lanes_count): what
// InnerLoop::kMoreNumerous avoids by choosing what most rays stand before.
//   while-while  rays cross nodes until every one of them has found a leaf; then each tests its leaf
//   if-if        in turn: rays that stand before a node cross it, then rays that stand before a leaf test it
// A lane whose ray is done takes the next job (their "persistent threads", a lane at a time).
// Called by trace_treelets(): the contract is its own, but for the sums of tests, which it makes. Any number of
// threads.
#pragma once

#include "treelets/touch_log.h"
#include "treelets/trace_treelet.h"

namespace shoal {

/// Requires: kWhileWhile or kIfIf.
void trace_lock_step(std::span<TraceJob> jobs, TraceCounters& counters, TriangleTest test, InnerLoop loop);
/// The same by TriangleTest::kWatertight, telling what is touched (treelets/trace_touching.h).
void trace_lock_step_touching(std::span<TraceJob> jobs, TraceCounters& counters, InnerLoop loop, TouchLog& log);

}  // namespace shoal
