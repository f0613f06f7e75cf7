#include "engine/run_on_threads.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "io/sanitizer_order.h"

namespace shoal {

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
