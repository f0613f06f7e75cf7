#include "bins/stop_signals.h"

#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <cstdint>

#include "io/result.h"

namespace shoal {
namespace {

// The only globals: a signal handler can reach nothing else.
std::atomic<bool> g_stop{false};
std::atomic<int64_t> g_stop_ns{0};  ///< when it was asked for; 0: not yet

int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// What is sent to a group of processes and again by one of them to another (a terminal and `shoal batch`) is one signal.
constexpr int64_t kSameSignalNs = 1'000'000'000;

/// The first asks to stop, a later one ends the process at once.
void on_signal(int) {
  const int64_t now = monotonic_ns();
  int64_t first = 0;
  if (g_stop_ns.compare_exchange_strong(first, now)) {
    g_stop = true;
  } else if (now - first > kSameSignalNs) {
    ::_exit(static_cast<int>(ErrorCode::kStopped));
  }
}

}  // namespace

const std::atomic<bool>* stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return &g_stop;
}

}  // namespace shoal
