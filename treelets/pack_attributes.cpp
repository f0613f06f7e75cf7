#include "treelets/pack_attributes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "treelets/attribute_layout.h"
#include "treelets/ray.h"

namespace shoal {
namespace {

constexpr uint32_t kMaxCornerFloats = 3 + 4 + 4 + 2 * 4;

const float* corners_of(const TriangleSoup& soup, uint32_t triangle) {
  return soup.corners.data() + size_t{3} * soup.layout.floats() * triangle;
}

// True when floats [begin, begin + count) of some corner have other bits than `value`.
bool differs(std::span<const uint32_t> triangles, const TriangleSoup& soup, uint32_t begin, uint32_t count,
             float value) {
  const uint32_t stride = soup.layout.floats(), bits = std::bit_cast<uint32_t>(value);
  for (const uint32_t triangle : triangles) {
    const float* corner = corners_of(soup, triangle);
    for (uint32_t c = 0; c < 3; ++c, corner += stride) {
      for (uint32_t i = begin; i < begin + count; ++i) {
        if (std::bit_cast<uint32_t>(corner[i]) != bits) return true;
      }
    }
  }
  return false;
}

// What of the soup's layout this treelet needs.
CornerLayout needed_layout(std::span<const uint32_t> triangles, const TriangleSoup& soup) {
  const CornerLayout& have = soup.layout;
  CornerLayout need;
  need.normal = have.normal && differs(triangles, soup, have.normal_offset(), 3, 0);
  need.tangent = have.tangent && differs(triangles, soup, have.tangent_offset(), 4, 0);
  need.color = have.color && differs(triangles, soup, have.color_offset(), 4, 1);
  for (uint32_t set = have.uv_count; set > 0 && need.uv_count == 0; --set) {
    if (differs(triangles, soup, have.uv_offset(set - 1), 2, 0)) need.uv_count = static_cast<uint8_t>(set);
  }
  return need;
}

// Copies one attribute; one that is not finite becomes its default.
void take_finite(const float* from, uint32_t count, float missing, float* out) {
  const bool finite = std::all_of(from, from + count, [](float v) { return std::isfinite(v); });
  for (uint32_t i = 0; i < count; ++i) out[i] = finite ? from[i] : missing;
}

// Copies the needed attributes of one corner.
void take(const float* corner, const CornerLayout& have, const CornerLayout& need, float* out) {
  if (need.normal) take_finite(corner + have.normal_offset(), 3, 0, out + need.normal_offset());
  if (need.tangent) take_finite(corner + have.tangent_offset(), 4, 0, out + need.tangent_offset());
  if (need.color) take_finite(corner + have.color_offset(), 4, 1, out + need.color_offset());
  for (uint32_t set = 0; set < need.uv_count; ++set) {
    take_finite(corner + have.uv_offset(set), 2, 0, out + need.uv_offset(set));
  }
}

// Corners by their bits: open addressing, a place holds an index plus one.
class VertexTable {
 public:
  VertexTable(size_t corner_count, uint32_t floats)
      : floats_(floats), places_(std::bit_ceil(2 * corner_count)), mask_(places_.size() - 1) {}

  uint32_t add(const float* vertex) {
    uint64_t hash = 0;
    for (uint32_t i = 0; i < floats_; ++i) {
      hash = (hash ^ std::bit_cast<uint32_t>(vertex[i])) * 0x9e3779b97f4a7c15ull;
      hash ^= hash >> 32;
    }
    for (size_t place = hash & mask_;; place = (place + 1) & mask_) {
      if (places_[place] == 0) {
        vertices_.insert(vertices_.end(), vertex, vertex + floats_);
        return (places_[place] = ++count_) - 1;
      }
      const float* other = &vertices_[size_t{places_[place] - 1} * floats_];
      if (std::memcmp(other, vertex, floats_ * sizeof(float)) == 0) return places_[place] - 1;
    }
  }
  uint32_t count() const { return count_; }
  const std::vector<float>& vertices() const { return vertices_; }

 private:
  uint32_t floats_, count_ = 0;
  std::vector<uint32_t> places_;
  size_t mask_;
  std::vector<float> vertices_;
};

class PageWriter {
 public:
  explicit PageWriter(size_t bytes) : page_(bytes) {}
  template <class T>
  uint32_t append(const std::vector<T>& values) {
    const size_t offset = page_.size();
    page_.resize(offset + (values.size() * sizeof(T) + 3) / 4 * 4);
    std::memcpy(&page_[offset], values.data(), values.size() * sizeof(T));
    return static_cast<uint32_t>(offset);
  }
  std::vector<std::byte> finish(const AttributeHeader& header) {
    std::memcpy(page_.data(), &header, sizeof header);
    return std::move(page_);
  }

 private:
  std::vector<std::byte> page_;
};

}  // namespace

std::vector<std::byte> pack_attributes(std::span<const uint32_t> triangles, const TriangleSoup& soup) {
  AttributeHeader header{};
  header.magic = kAttributeMagic;
  header.triangle_count = static_cast<uint32_t>(triangles.size());
  header.uniform_material = soup.material[triangles[0]];
  for (const uint32_t triangle : triangles) {
    if (soup.material[triangle] != header.uniform_material) header.uniform_material = kNoIndex;
  }
  const CornerLayout need = needed_layout(triangles, soup);
  if (header.uniform_material != kNoIndex && need.floats() == 0) return {};
  header.has_normal = need.normal, header.has_tangent = need.tangent, header.has_color = need.color;
  header.uv_count = need.uv_count;
  header.index_bytes = 2;

  PageWriter writer(sizeof header);
  if (header.uniform_material == kNoIndex) {
    std::vector<uint32_t> materials;
    for (const uint32_t triangle : triangles) materials.push_back(soup.material[triangle]);
    header.materials_offset = writer.append(materials);
  }
  if (need.floats() > 0) {
    VertexTable table(3 * triangles.size(), need.floats());
    std::vector<uint32_t> index;
    index.reserve(3 * triangles.size());
    for (const uint32_t triangle : triangles) {
      const float* corner = corners_of(soup, triangle);
      for (uint32_t c = 0; c < 3; ++c, corner += soup.layout.floats()) {
        float vertex[kMaxCornerFloats];
        take(corner, soup.layout, need, vertex);
        index.push_back(table.add(vertex));
      }
    }
    header.vertex_count = table.count();
    header.index_bytes = table.count() <= 65536 ? 2 : 4;
    header.indices_offset = header.index_bytes == 4
                                ? writer.append(index)
                                : writer.append(std::vector<uint16_t>(index.begin(), index.end()));
    header.vertices_offset = writer.append(table.vertices());
  }
  return writer.finish(header);
}

}  // namespace shoal
