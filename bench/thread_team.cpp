#include "bench/thread_team.h"

#include <time.h>

#include <numeric>
#include <thread>
#include <vector>

#include "engine/clock.h"

namespace shoal::bench {

double thread_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

TeamSeconds run_together(unsigned threads, const std::function<void(unsigned)>& work) {
  std::vector<double> cpu(threads);
  const auto timed = [&](unsigned thread) {
    const double start = thread_cpu_seconds();
    work(thread);
    cpu[thread] = thread_cpu_seconds() - start;
  };
  const double start = now_seconds();
  {
    std::vector<std::jthread> others;
    for (unsigned thread = 1; thread < threads; ++thread) others.emplace_back(timed, thread);
    timed(0);
  }
  return {now_seconds() - start, std::accumulate(cpu.begin(), cpu.end(), 0.0) / threads};
}

}  // namespace shoal::bench
