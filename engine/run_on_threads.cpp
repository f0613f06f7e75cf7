#include "engine/run_on_threads.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace shoal {
namespace {

// The thread sanitizer does not see into oneTBB: it is told that what comes before `place` on one thread comes before
// what comes after it on another.
#if defined(__SANITIZE_THREAD__)
void tell_sanitizer_before(const void* place) { __tsan_release(const_cast<void*>(place)); }
void tell_sanitizer_after(const void* place) { __tsan_acquire(const_cast<void*>(place)); }
#else
void tell_sanitizer_before(const void* /*place*/) {}
void tell_sanitizer_after(const void* /*place*/) {}
#endif

}  // namespace

void run_on_threads(unsigned threads, const std::function<void(unsigned)>& work) {
  tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
  tbb::task_arena arena(static_cast<int>(threads));
  const auto told = [&](unsigned thread) {
    tell_sanitizer_after(&work);
    work(thread);
    tell_sanitizer_before(&work);
  };
  tell_sanitizer_before(&work);
  arena.execute([&] { tbb::parallel_for(0u, threads, told, tbb::simple_partitioner()); });
  tell_sanitizer_after(&work);
}

}  // namespace shoal
