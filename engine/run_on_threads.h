// Threads of a oneTBB arena. Called by the orders (engine/render_worker), engine/adaptive_sampling and benches, from one
// thread at a time: the limit of threads is the process's. Cost: waking them, and waiting for the last.
#pragma once

#include <functional>

namespace shoal {

/// Runs `work(thread index)` on `threads` threads of a oneTBB arena.
void run_on_threads(unsigned threads, const std::function<void(unsigned)>& work);

}  // namespace shoal
