#include "treelets/build_object.h"

#include <fmt/format.h>

#include "treelets/build_forest.h"

namespace shoal {
namespace {

constexpr uint64_t kMaxObjectTriangles = (1ull << 31) - 1;

}  // namespace

Result<BuiltObject> build_object(TriangleSoup&& soup, const BuildOptions& options, const CoverageSource* coverage,
                                 TreeletSink& sink) {
  if (soup.size() > kMaxObjectTriangles) {
    return Error{ErrorCode::kInput,
                 fmt::format("an object of {} triangles: expected at most {}", soup.size(), kMaxObjectTriangles)};
  }
  if (options.treelet_bytes < kMinTreeletBytes || options.treelet_bytes > kMaxTreeletBytes) {
    return Error{ErrorCode::kUsage, fmt::format("treelet size of {} bytes: expected {} to {}",
                                                options.treelet_bytes, kMinTreeletBytes, kMaxTreeletBytes)};
  }
  UpperForest forest;
  std::vector<TreeletEntry> entries;
  ForestSums sums;
  SHOAL_RETURN_IF_ERROR(build_forest(std::move(soup), {}, 1, options, coverage, sink, forest, entries, sums));
  return finish_object(forest.nodes, std::move(entries), sums);
}

}  // namespace shoal
