#include "engine/pareto_front.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>

namespace shoal {

std::vector<bool> pareto_front(std::span<const PricedError> choices) {
  std::vector<size_t> by_price(choices.size());
  std::iota(by_price.begin(), by_price.end(), size_t{0});
  std::sort(by_price.begin(), by_price.end(), [&](size_t a, size_t b) {
    return std::tie(choices[a].price, choices[a].error) < std::tie(choices[b].price, choices[b].error);
  });
  std::vector<bool> front(choices.size(), false);
  PricedError best{0, std::numeric_limits<double>::infinity()};
  for (const size_t at : by_price) {
    const PricedError& choice = choices[at];
    const bool equal = choice.error == best.error && choice.price == best.price;
    if (choice.error < best.error || equal) front[at] = true, best = choice;
  }
  return front;
}

}  // namespace shoal
