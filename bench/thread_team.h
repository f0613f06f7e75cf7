// Threads that run one piece of work together, and how long that took. Threads are started for each call (some 50
// microseconds), so that nothing of one program lingers while another is measured. Called by bench only.
#pragma once

#include <functional>

namespace shoal::bench {

struct TeamSeconds {
  double wall = 0;  ///< from before the first thread begins to after the last one ends
  double cpu = 0;   ///< mean of the threads: hardly disturbed by others on the machine, but blind to uneven shares
};

/// Runs `work(0)` .. `work(threads - 1)` at once, one of them on the calling thread.
TeamSeconds run_together(unsigned threads, const std::function<void(unsigned)>& work);

/// CPU time of the calling thread.
double thread_cpu_seconds();

}  // namespace shoal::bench
