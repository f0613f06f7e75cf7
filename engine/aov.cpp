#include "engine/aov.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {
namespace {

constexpr AovInfo kAovs[kAovCount] = {
    {"albedo", "RGB", 24},   {"normal", "XYZ", 24},   {"depth", "Z", 16},      {"position", "XYZ", 48},
    {"variance", "RGB", 72}, {"samples", "Y", 0},     {"object_id", "Y", 4},   {"material_id", "Y", 4},
    {"treelets", "Y", 8},    {"bytes", "Y", 8},
};
constexpr AovSet kAllAovs{(1u << kAovCount) - 1};

Result<AovSet> parse_one(std::string_view name) {
  if (name == "all") return kAllAovs;
  AovSet set;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    if (kAovs[i].name == name) set.add(Aov(i));
  }
  if (!set.empty()) return set;
  return Error{ErrorCode::kUsage, fmt::format("unknown AOV '{}': expected {} or all, separated by commas", name,
                                              fmt::join(aov_names(kAllAovs), ", "))};
}

}  // namespace

const AovInfo& aov_info(Aov aov) { return kAovs[static_cast<uint32_t>(aov)]; }

bool AovSet::of_surface() const {
  return has(Aov::kAlbedo) || has(Aov::kNormal) || has(Aov::kDepth) || has(Aov::kPosition) || has(Aov::kObjectId) ||
         has(Aov::kMaterialId);
}

Result<AovSet> parse_aovs(const std::string& text) {
  AovSet set;
  if (text.empty()) return set;
  for (size_t at = 0; at <= text.size();) {
    const size_t comma = std::min(text.find(',', at), text.size());
    SHOAL_ASSIGN_OR_RETURN(const AovSet more, parse_one(std::string_view(text).substr(at, comma - at)));
    set.bits |= more.bits;
    at = comma + 1;
  }
  return set;
}

std::vector<std::string> aov_names(AovSet set) {
  std::vector<std::string> names;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    if (set.has(Aov(i))) names.emplace_back(kAovs[i].name);
  }
  return names;
}

}  // namespace shoal
