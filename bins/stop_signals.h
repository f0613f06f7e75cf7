// SIGINT and SIGTERM as a flag that long work looks at. Called by the commands that render. Process-wide: one handler.
#pragma once

#include <atomic>

namespace shoal {

/// Becomes true at SIGINT or SIGTERM, from this call on. One that comes more than a second later ends the process at once,
/// with code 9.
const std::atomic<bool>* stop_on_signals();

}  // namespace shoal
