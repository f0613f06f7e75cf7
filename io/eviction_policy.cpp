#include "io/eviction_policy.h"

#include <array>

namespace shoal {

std::span<const std::string_view> eviction_policy_names() {
  static constexpr std::array<std::string_view, 3> kNames{"least-demand", "least-waiting", "least-recent"};
  return kNames;
}

std::unique_ptr<EvictionPolicy> make_eviction_policy(std::string_view name) {
  if (name == "least-waiting") return make_least_waiting_eviction();
  if (name == "least-demand") return make_least_demand_eviction();
  if (name == "least-recent") return make_least_recent_eviction();
  return nullptr;
}

}  // namespace shoal
