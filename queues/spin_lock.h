// A lock for critical sections of a few instructions that are hardly ever contended (one queue of thousands).
// Called by queues only. Cost: one atomic exchange.
#pragma once

#include <atomic>
#include <thread>

namespace shoal {

class SpinLock {
 public:
  void lock() {
    for (int spins = 0; flag_.exchange(true, std::memory_order_acquire); ++spins) {
      if (spins > 64) std::this_thread::yield();
    }
  }
  void unlock() { flag_.store(false, std::memory_order_release); }

 private:
  std::atomic<bool> flag_{false};
};

}  // namespace shoal
