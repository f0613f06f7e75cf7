#include "engine/scene_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "treelets/treelet_layout.h"

namespace shoal {

Result<TreeletId> TreeletPageSink::add(std::span<const std::byte> geometry, std::span<const std::byte> attributes) {
  SHOAL_CHECK(geometry.size() >= sizeof(TreeletHeader));
  if (stop_ != nullptr && stop_->load(std::memory_order_relaxed)) {
    return Error{ErrorCode::kStopped, "the build was stopped before it was complete"};
  }
  const size_t largest = std::max(geometry.size(), attributes.size());
  if (largest > kMaxPageBytes) {
    return Error{ErrorCode::kUsage, fmt::format("a treelet's page: expected at most {} bytes, found {}: choose a "
                                                "smaller treelet size",
                                                kMaxPageBytes, largest)};
  }
  TreeletHeader header;
  std::memcpy(&header, geometry.data(), sizeof(header));
  TreeletPages pages;
  pages.triangle_count = header.triangle_count;
  SHOAL_ASSIGN_OR_RETURN(pages.geometry, writer_->append(PageKind::kTreelet, geometry));
  geometry_bytes_ += geometry.size();
  largest_geometry_bytes_ = std::max(largest_geometry_bytes_, static_cast<uint32_t>(geometry.size()));
  if (!attributes.empty()) {
    SHOAL_ASSIGN_OR_RETURN(pages.attributes, writer_->append(PageKind::kAttributes, attributes));
    attribute_bytes_ += attributes.size();
    largest_attribute_bytes_ = std::max(largest_attribute_bytes_, static_cast<uint32_t>(attributes.size()));
  }
  treelets_.push_back(pages);
  return static_cast<TreeletId>(treelets_.size() - 1);
}

void TreeletPageSink::fill(SceneHeader& header) const {
  header.geometry_bytes = geometry_bytes_;
  header.attribute_bytes = attribute_bytes_;
  header.largest_treelet_bytes = largest_geometry_bytes_;
  header.largest_attribute_bytes = largest_attribute_bytes_;
}

}  // namespace shoal
