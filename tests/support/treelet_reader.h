// Reads built treelets back, byte by byte from the layout headers alone: an independent witness of what the builder
// wrote. Slow and plain. Any breach of the layout is thrown as std::runtime_error with its place.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "io/result.h"
#include "treelets/build_object.h"
#include "treelets/treelet_layout.h"
#include "treelets/treelet_sink.h"

namespace shoal::testing {

struct StoredTreelet {
  std::vector<std::byte> geometry, attributes;
  bool operator==(const StoredTreelet&) const = default;
};

/// Keeps everything; fails from page `fail_at` on.
class MemorySink : public TreeletSink {
 public:
  explicit MemorySink(size_t fail_at = SIZE_MAX) : fail_at_(fail_at) {}
  Result<TreeletId> add(std::span<const std::byte> geometry, std::span<const std::byte> attributes) override {
    if (treelets.size() >= fail_at_) return Error{ErrorCode::kStorage, "the sink is full"};
    treelets.push_back({{geometry.begin(), geometry.end()}, {attributes.begin(), attributes.end()}});
    return static_cast<TreeletId>(treelets.size() - 1);
  }
  std::vector<StoredTreelet> treelets;

 private:
  size_t fail_at_;
};

/// Every attribute that a corner can have, with defaults where the page has none: normal, tangent, color, 4 uv
/// sets.
using FullCorner = std::array<float, 3 + 4 + 4 + 8>;

struct ReadTriangle {
  float position[9];
  uint32_t primitive = 0, material = 0;
  FullCorner corner[3];
  std::optional<CoverageRecord> coverage;
  std::vector<uint8_t> texels;  ///< of the crop
  TreeletId treelet = 0;
  uint32_t depth = 0;  ///< nodes of the treelet from the entry's root to the leaf, the leaf counted
  uint32_t top_depth = 0;
};

struct ReadCounts {
  uint64_t leaves = 0, grid_leaves = 0, wide_nodes = 0, wide_children = 0, top_nodes = 0, entries = 0;
};

/// Visits every triangle below the object's root. Throws also when a vertex lies outside a box above it, evaluated
/// as traversal does, and when a page, link or index is not what the layout says.
ReadCounts read_object(const BuiltObject& object, const std::vector<StoredTreelet>& treelets,
                       const std::function<void(const ReadTriangle&)>& visit);

}  // namespace shoal::testing
