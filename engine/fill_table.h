// A table whose cells do not depend on each other, filled by several threads: the same bits by any number of them.
// Called by engine/energy_table and engine/lobe_tables. The calling thread is one of the threads.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace shoal {

/// cells[i] = cell(i) for every i.
template <class Cell, class Function>
void fill_table(std::vector<Cell>& cells, unsigned threads, const Function& cell) {
  const auto fill = [&](size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) cells[i] = cell(i);
  };
  constexpr size_t kCellsOfTask = 16;  // from a microsecond to a tenth of a millisecond each
  const int workers = std::min(static_cast<int>(threads), tbb::this_task_arena::max_concurrency());
  if (workers <= 1) return fill(0, cells.size());
  tbb::task_arena(workers).execute([&] {
    using Range = tbb::blocked_range<size_t>;
    tbb::parallel_for(Range(0, cells.size(), kCellsOfTask), [&](const Range& r) { fill(r.begin(), r.end()); });
  });
}

}  // namespace shoal
