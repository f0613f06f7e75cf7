// Which of several choices are worth having: those that no other beats in both price and error. Called by
// engine/accuracy. Plain function. Cost: n log n.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace shoal {

struct PricedError {
  double price = 0, error = 0;
};

/// True where no other entry is at most as dear and at most as wrong, and one of both less. Equal entries stand together.
std::vector<bool> pareto_front(std::span<const PricedError> choices);

}  // namespace shoal
