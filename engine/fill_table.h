// A table whose cells do not depend on each other, filled by several threads: the same bits by any number of them.
// Called by engine/energy_table and engine/lobe_tables. The calling thread is one of the threads.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace shoal {

/// fill(first, last) for ranges that together are [0, count), each once.
void fill_ranges(size_t count, unsigned threads, const std::function<void(size_t, size_t)>& fill);

/// cells[i] = cell(i) for every i.
template <class Cell, class Function>
void fill_table(std::vector<Cell>& cells, unsigned threads, const Function& cell) {
  fill_ranges(cells.size(), threads, [&](size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) cells[i] = cell(i);
  });
}

}  // namespace shoal
