// Which builder makes the binary trees under the treelets of a file (treelets/bvh_builder.h). It decides how fast a
// picture is made and never what is in it. Included by options and headers of files; plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace shoal {

/// Numbers are those of the file (docs/file_format.md).
enum class BvhBuilder : uint8_t {
  kSah = 0,     ///< binned SAH, top down (treelets/binned_sah.h)
  kLbvh = 1,    ///< along a Morton curve (treelets/linear_bvh.h)
  kKarras = 2,  ///< the same, restructured (treelets/restructured_bvh.h)
};
inline constexpr std::array kBvhBuilders{BvhBuilder::kSah, BvhBuilder::kLbvh, BvhBuilder::kKarras};

inline constexpr std::string_view bvh_builder_name(BvhBuilder builder) {
  return builder == BvhBuilder::kLbvh ? "lbvh" : builder == BvhBuilder::kKarras ? "karras" : "sah";
}
inline constexpr std::optional<BvhBuilder> find_bvh_builder(std::string_view name) {
  for (const BvhBuilder builder : kBvhBuilders) {
    if (bvh_builder_name(builder) == name) return builder;
  }
  return std::nullopt;
}

}  // namespace shoal
