// Threads of a oneTBB arena. Called by the orders (engine/render_worker) and by engine/adaptive_sampling.
#pragma once

#include <functional>

namespace shoal {

/// Runs `work(thread index)` on `threads` threads of a oneTBB arena.
void run_on_threads(unsigned threads, const std::function<void(unsigned)>& work);

}  // namespace shoal
