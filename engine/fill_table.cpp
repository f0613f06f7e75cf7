#include "engine/fill_table.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace shoal {

void fill_ranges(size_t count, unsigned threads, const std::function<void(size_t, size_t)>& fill) {
  constexpr size_t kCellsOfTask = 16;  // from a microsecond to a tenth of a millisecond each
  const int workers = std::min(static_cast<int>(threads), tbb::this_task_arena::max_concurrency());
  if (workers <= 1) return fill(0, count);
  tbb::task_arena(workers).execute([&] {
    using Range = tbb::blocked_range<size_t>;
    tbb::parallel_for(Range(0, count, kCellsOfTask), [&](const Range& r) { fill(r.begin(), r.end()); });
  });
}

}  // namespace shoal
