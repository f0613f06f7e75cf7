#include "bins/order_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bins/render_options.h"
#include "queues/drain_policy.h"

namespace shoal {
namespace {

Result<OrderChoice> parse_one(const std::string& name) {
  const size_t colon = name.find(':');
  OrderChoice choice{name, Order::kAuto, colon == std::string::npos ? "" : name.substr(colon + 1)};
  SHOAL_ASSIGN_OR_RETURN(choice.order, parse_order(name.substr(0, colon)));
  if (colon == std::string::npos) return choice;
  if (choice.order != Order::kQueued) {
    return Error{ErrorCode::kUsage, fmt::format("'{}': only the queued order has drain policies", name)};
  }
  const auto policies = drain_policy_names();
  if (std::find(policies.begin(), policies.end(), choice.policy) == policies.end()) {
    return Error{ErrorCode::kUsage, fmt::format("'{}': expected a policy of {}", name, fmt::join(policies, ", "))};
  }
  return choice;
}

}  // namespace

Result<std::vector<OrderChoice>> parse_order_choices(const std::vector<std::string>& names) {
  std::vector<OrderChoice> choices;
  for (const std::string& name : names) {
    SHOAL_ASSIGN_OR_RETURN(OrderChoice choice, parse_one(name));
    if (std::any_of(choices.begin(), choices.end(), [&](const OrderChoice& c) { return c.label == name; })) {
      return Error{ErrorCode::kUsage, fmt::format("--orders names '{}' twice", name)};
    }
    choices.push_back(std::move(choice));
  }
  return choices;
}

}  // namespace shoal
