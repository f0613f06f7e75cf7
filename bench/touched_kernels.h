// TopTree::next() and trace_treelets() over again, with every byte they touch told to a TouchMeter: the same nodes and
// leaves in the same order, as many rays in turn, by the same arithmetic (the box and leaf tests are the kernels' own).
// So answers and numbers of tests are those of the kernels, to the bit; who calls this checks that they are.
// Called by bench/touched_group. One thread. Cost: some ten times the kernels'.
//
// Not told: reading a second time what a step has just read (a candidate's corners after the leaf's vertices), and what
// lies on the stack for the length of a call (lanes but for their stacks). A ray's context is told once a call, not at
// every test. A ray too extreme for the vector form is traced by the kernel, and its treelet not told.
#pragma once

#include <span>

#include "bench/touch_meter.h"
#include "treelets/ray_space.h"
#include "treelets/trace_treelet.h"

namespace shoal::bench {

/// Requires: tree.instance_count() == 1, and world and object space are the same bits.
void next_entries_touching(const TopTree& tree, std::span<NextJob> jobs, TouchMeter& meter);

/// Requires: as trace_treelets(), of such a tree. Tests are counted in the jobs.
void trace_treelets_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchMeter& meter);

}  // namespace shoal::bench
