// An order as `--orders` of `shoal compare` names it: "queued", or with its drain policy "queued:full". Called by
// bins.
#pragma once

#include <string>
#include <vector>

#include "engine/render.h"
#include "io/result.h"

namespace shoal {

struct OrderChoice {
  std::string label;  ///< as it was named
  Order order;
  std::string policy;  ///< empty: that of --policy

  void apply(ExecutionOptions& execution) const {
    execution.order = order;
    if (!policy.empty()) execution.policy = policy;
  }
};

/// Each once. Fails with: kUsage (an unknown order or policy, a policy of an order that has no queues, a name
/// twice).
Result<std::vector<OrderChoice>> parse_order_choices(const std::vector<std::string>& names);

}  // namespace shoal
