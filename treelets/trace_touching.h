// The kernels of tracing, telling a TouchLog every byte that they touch: the very templates behind TopTree::next(),
// trace_treelets(), SceneTracer and every SceneTraversal, compiled a second time with a meter, for the same instruction
// sets. So answers and numbers of tests are those of the kernels to the bit. Called by engine/ray_group and benches. One
// thread a log.
// Cost: some three times that of the kernel, beside what the log's sink does.
//
// Not told: reading a second time what a step has just read (a candidate's corners after its leaf), and what lies on the
// machine's stack for the length of one test. Rays too extreme for the vector form are traced by the scalar kernel, and
// what they touch in the treelet is not told; nor is anything of a scene whose top tree is too deep for the stacks of
// SceneTracer and SceneTraversal.
#pragma once

#include <span>

#include "treelets/touch_log.h"
#include "treelets/trace_treelet.h"

namespace shoal {

/// As tree.next().
void next_entries_touching(const TopTree& tree, std::span<NextJob> jobs, TouchLog& log);

/// As trace_treelets() by TriangleTest::kWatertight.
void trace_treelets_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchLog& log,
                             InnerLoop loop = InnerLoop::kMoreNumerous);

}  // namespace shoal
