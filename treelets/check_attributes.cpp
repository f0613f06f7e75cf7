#include <fmt/format.h>

#include <cmath>

#include "treelets/attribute_view.h"
#include "treelets/trace_treelet.h"

namespace shoal {
namespace {

Error corrupt(std::string message) { return {ErrorCode::kCorrupt, "attribute page: " + std::move(message)}; }

/// An array of `bytes` at `offset` lies between the header and the end of the page.
Status check_array(std::span<const std::byte> page, const char* name, uint64_t offset, uint64_t bytes) {
  if (offset % 4 == 0 && offset >= sizeof(AttributeHeader) && bytes <= page.size() &&
      offset <= page.size() - bytes) {
    return {};
  }
  return corrupt(fmt::format("{}: {} bytes at {} do not fit in {}", name, bytes, offset, page.size()));
}

Status check_header(std::span<const std::byte> page) {
  if (page.size() < sizeof(AttributeHeader)) {
    return corrupt(fmt::format("expected at least {} bytes, found {}", sizeof(AttributeHeader), page.size()));
  }
  const AttributeView view(page);
  const AttributeHeader& h = *view.header;
  if (h.magic != kAttributeMagic) {
    return corrupt(fmt::format("magic: expected {:#x}, found {:#x}", kAttributeMagic, h.magic));
  }
  if (h.uv_count > 4) return corrupt(fmt::format("{} uv sets, expected at most 4", h.uv_count));
  if (h.uniform_material == kNoIndex) {
    SHOAL_RETURN_IF_ERROR(check_array(page, "materials", h.materials_offset, uint64_t{4} * h.triangle_count));
  }
  if (h.vertex_count == 0) return {};
  if (h.index_bytes != 2 && h.index_bytes != 4) {
    return corrupt(fmt::format("indices of {} bytes, expected 2 or 4", h.index_bytes));
  }
  SHOAL_RETURN_IF_ERROR(
      check_array(page, "indices", h.indices_offset, uint64_t{3} * h.triangle_count * h.index_bytes));
  return check_array(page, "vertices", h.vertices_offset, uint64_t{4} * h.vertex_count * view.layout().floats());
}

}  // namespace

Status check_attributes(std::span<const std::byte> page) {
  SHOAL_RETURN_IF_ERROR(check_header(page));
  const AttributeView view(page);
  const AttributeHeader& h = *view.header;
  if (h.vertex_count == 0) return {};
  for (uint64_t corner = 0; corner < uint64_t{3} * h.triangle_count; ++corner) {
    if (view.vertex_index(corner) >= h.vertex_count) {
      return corrupt(
          fmt::format("corner {} names vertex {} of {}", corner, view.vertex_index(corner), h.vertex_count));
    }
  }
  const uint64_t floats = uint64_t{h.vertex_count} * view.layout().floats();
  for (uint64_t i = 0; i < floats; ++i) {
    if (!std::isfinite(view.vertex(0)[i])) return corrupt(fmt::format("value {} is not finite", i));
  }
  return {};
}

TriangleAttributes find_attributes(std::span<const std::byte> page, uint32_t ordinal) {
  const AttributeView view(page);
  const AttributeHeader& h = *view.header;
  TriangleAttributes result;
  result.material = h.uniform_material != kNoIndex ? h.uniform_material : view.material(ordinal);
  if (h.vertex_count == 0) return result;
  const CornerLayout layout = view.layout();
  for (uint32_t k = 0; k < 3; ++k) {
    const float* v = view.vertex(view.vertex_index(uint64_t{3} * ordinal + k));
    CornerAttributes& corner = result.corner[k];
    if (layout.normal) {
      const float* n = v + layout.normal_offset();
      corner.normal = {n[0], n[1], n[2]};
    }
    if (layout.tangent) {
      const float* t = v + layout.tangent_offset();
      corner.tangent = {t[0], t[1], t[2], t[3]};
    }
    if (layout.color) {
      const float* c = v + layout.color_offset();
      corner.color = {c[0], c[1], c[2], c[3]};
    }
    for (uint32_t set = 0; set < layout.uv_count; ++set) {
      const float* uv = v + layout.uv_offset(set);
      corner.uv[set] = {uv[0], uv[1]};
    }
  }
  return result;
}

}  // namespace shoal
