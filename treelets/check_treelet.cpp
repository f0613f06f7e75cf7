#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <vector>

#include "treelets/box_test.h"
#include "treelets/coverage.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_view.h"

namespace shoal {
namespace {

Error corrupt(std::string message) { return {ErrorCode::kCorrupt, "treelet page: " + std::move(message)}; }

/// Texel coordinates up to here keep an integer part that int64_t holds with room to spare.
constexpr float kMaxTexelCoordinate = 0x1p40f;
constexpr uint32_t kMaxLevelTexels = 1u << 16;

Status check_header(std::span<const std::byte> page) {
  if (page.size() < sizeof(TreeletHeader)) {
    return corrupt(fmt::format("expected at least {} bytes, found {}", sizeof(TreeletHeader), page.size()));
  }
  const TreeletHeader& h = *reinterpret_cast<const TreeletHeader*>(page.data());
  if (h.magic != kTreeletMagic)
    return corrupt(fmt::format("magic: expected {:#x}, found {:#x}", kTreeletMagic, h.magic));
  const uint64_t nodes_end = sizeof(TreeletHeader) + uint64_t{h.node_count} * sizeof(QuantizedNode);
  const uint64_t leaves_end = uint64_t{h.leaves_offset} + h.leaves_bytes;
  if (h.leaves_offset % 4 != 0 || h.leaves_offset < nodes_end || leaves_end > page.size()) {
    return corrupt(fmt::format("leaves at {}, {} bytes, do not fit between {} nodes and the end at {}",
                               h.leaves_offset, h.leaves_bytes, h.node_count, page.size()));
  }
  if (h.leaves_bytes / 4 >= 1u << 27)
    return corrupt(fmt::format("{} bytes of leaves are too many", h.leaves_bytes));
  if (h.coverage_offset == 0) return {};
  const uint64_t coverage_end = uint64_t{h.coverage_offset} + uint64_t{4} * h.triangle_count +
                                uint64_t{h.coverage_record_count} * sizeof(CoverageRecord) + h.coverage_texel_bytes;
  if (h.coverage_offset % 4 != 0 || h.coverage_offset < leaves_end || coverage_end > page.size()) {
    return corrupt(fmt::format("coverage at {} does not fit between the leaves' end at {} and the page's at {}",
                               h.coverage_offset, leaves_end, page.size()));
  }
  return {};
}

Status check_positions(const LeafView& leaf, uint64_t at) {
  for (uint32_t axis = 0; axis < 3; ++axis) {
    for (uint32_t vertex = 0; vertex < leaf.vertex_count; ++vertex) {
      if (!std::isfinite(leaf.coordinate(axis, vertex))) {
        return corrupt(fmt::format("leaf at {} has a position that is not finite", at));
      }
    }
  }
  return {};
}

Status check_leaf(const TreeletView& treelet, uint32_t offset) {
  const TreeletHeader& h = *treelet.header;
  const uint64_t at = uint64_t{4} * offset;
  if (at + sizeof(LeafHeader) > h.leaves_bytes) {
    return corrupt(fmt::format("leaf at {} lies past the {} bytes of leaves", at, h.leaves_bytes));
  }
  const LeafView leaf = treelet.leaf(offset);
  const uint32_t triangles = leaf.triangle_count, vertices = leaf.vertex_count;
  if (triangles < 1 || triangles > kMaxLeafTriangles || vertices < 1 || vertices > 3 * triangles) {
    return corrupt(fmt::format("leaf at {} has {} triangles and {} vertices", at, triangles, vertices));
  }
  const uint8_t flags = leaf.header().flags;
  if ((flags & ~(kLeafHighMask | kLeafFloats | kLeafCoverage | kLeafGrid)) != 0 ||
      (leaf.has_floats() && (flags & (kLeafHighMask | kLeafGrid)) != 0) || leaf.header().primitive_bytes > sizeof(uint32_t)) {
    return corrupt(fmt::format("leaf at {} has flags {:#x} and {} bytes a primitive id", at, flags,
                               leaf.header().primitive_bytes));
  }
  if (at + leaf.bytes() > h.leaves_bytes) {
    return corrupt(fmt::format("leaf at {} ends past the {} bytes of leaves", at, h.leaves_bytes));
  }
  SHOAL_RETURN_IF_ERROR(check_positions(leaf, at));
  for (uint32_t i = 0; i < 3 * triangles; ++i) {
    if (leaf.corner(0)[i] >= vertices) {
      return corrupt(fmt::format("leaf at {} names vertex {} of {}", at, leaf.corner(0)[i], vertices));
    }
  }
  if (uint64_t{leaf.header().first_ordinal} + triangles > h.triangle_count) {
    return corrupt(fmt::format("leaf at {} has ordinals from {}, the page {} triangles", at,
                               leaf.header().first_ordinal, h.triangle_count));
  }
  if (leaf.has_coverage() && h.coverage_offset == 0) {
    return corrupt(fmt::format("leaf at {} has coverage, the page none", at));
  }
  return {};
}

/// Planes may be infinite (they enclose anything), never NaN.
Status check_grid(const QuantizedNode& node, uint32_t index) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(node.origin[axis]) || node.exponent[axis] < kMinGridPower) {
      return corrupt(fmt::format("node {} has a grid with origin {} and exponent {}", index, node.origin[axis],
                                 node.exponent[axis]));
    }
  }
  return {};
}

/// Children come after their parent and have one parent only: no loops, each node met at most once.
Status check_nodes(const TreeletView& treelet) {
  const uint32_t count = treelet.header->node_count;
  std::vector<uint8_t> depth(count, 0);  // nodes above it; 0: a root, or not met yet
  for (uint32_t index = 0; index < count; ++index) {
    const QuantizedNode& node = treelet.nodes[index];
    SHOAL_RETURN_IF_ERROR(check_grid(node, index));
    if (node.child_count > 8) return corrupt(fmt::format("node {} has {} children", index, node.child_count));
    for (uint32_t slot = 0; slot < node.child_count; ++slot) {
      const NodeRef ref = node.child[slot];
      if (ref == kEmptyRef)
        return corrupt(fmt::format("node {} has an empty slot {} among its children", index, slot));
      if (depth[index] + 1u > kMaxTreeletDepth) return corrupt(fmt::format("node {} lies too deep", index));
      if (is_leaf(ref)) {
        SHOAL_RETURN_IF_ERROR(check_leaf(treelet, leaf_offset(ref)));
        continue;
      }
      if (ref <= index || ref >= count) {
        return corrupt(fmt::format("node {} of {} names node {} as a child", index, count, ref));
      }
      if (depth[ref] != 0) return corrupt(fmt::format("node {} has two parents", ref));
      depth[ref] = static_cast<uint8_t>(depth[index] + 1);
    }
  }
  return {};
}

bool is_texel_coordinate(float x) { return std::abs(x) <= kMaxTexelCoordinate; }

Status check_record(const TreeletHeader& h, const CoverageRecord& record, uint32_t index) {
  if (record.mode > static_cast<uint8_t>(CoverageMode::kBlend) ||
      record.wrap_u > static_cast<uint8_t>(WrapMode::kClampToEdge) ||
      record.wrap_v > static_cast<uint8_t>(WrapMode::kClampToEdge)) {
    return corrupt(fmt::format("coverage record {} has an unknown mode", index));
  }
  if (record.crop_width == 0) return {};
  for (const float x : record.uv) {
    if (!is_texel_coordinate(x)) return corrupt(fmt::format("coverage record {} has a uv out of range", index));
  }
  const uint64_t texels = uint64_t{record.crop_width} * record.crop_height;
  if (record.crop_width > kMaxLevelTexels || record.crop_height > kMaxLevelTexels || texels == 0 ||
      record.texel_offset + texels > h.coverage_texel_bytes) {
    return corrupt(fmt::format("coverage record {}: {} x {} texels at {} do not fit in {}", index,
                               record.crop_width, record.crop_height, record.texel_offset, h.coverage_texel_bytes));
  }
  return {};
}

Status check_coverage(const TreeletView& treelet) {
  const TreeletHeader& h = *treelet.header;
  if (h.coverage_offset == 0) return {};
  for (uint32_t i = 0; i < h.triangle_count; ++i) {
    const uint32_t record = treelet.coverage_of()[i];
    if (record != kNoIndex && record >= h.coverage_record_count) {
      return corrupt(fmt::format("triangle {} names coverage record {} of {}", i, record, h.coverage_record_count));
    }
  }
  for (uint32_t i = 0; i < h.coverage_record_count; ++i) {
    SHOAL_RETURN_IF_ERROR(check_record(h, treelet.coverage_records()[i], i));
  }
  return {};
}

}  // namespace

Status check_treelet(std::span<const std::byte> page) {
  SHOAL_RETURN_IF_ERROR(check_header(page));
  const TreeletView treelet(page);
  SHOAL_RETURN_IF_ERROR(check_nodes(treelet));
  return check_coverage(treelet);
}

Status check_root(std::span<const std::byte> page, uint32_t root) {
  const TreeletView treelet(page);
  if (root == kEmptyRef) return corrupt("an empty root");
  if (is_leaf(root)) return check_leaf(treelet, leaf_offset(root));
  if (root >= treelet.header->node_count) {
    return corrupt(fmt::format("root {} of {} nodes", root, treelet.header->node_count));
  }
  return {};
}

}  // namespace shoal
