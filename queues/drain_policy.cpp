#include "queues/drain_policy.h"

#include <array>

namespace shoal {

std::span<const std::string_view> drain_policy_names() {
  static constexpr std::array<std::string_view, 4> kNames{"resident-first", "fullest", "sweep", "full"};
  return kNames;
}

std::unique_ptr<DrainPolicy> make_drain_policy(std::string_view name, const PolicyOptions& options) {
  if (name == "fullest") return make_fullest_policy(options);
  if (name == "sweep") return make_sweep_policy(options);
  if (name == "resident-first") return make_resident_first_policy(options);
  if (name == "full") return make_full_policy(options);
  return nullptr;
}

}  // namespace shoal
