// Treelet pages packed by hand for tests of traversal: median splits into 8-wide nodes, in the layout of
// treelets/treelet_layout.h, written independently of the product's builder. Header only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <span>
#include <vector>

#include "treelets/box_test.h"
#include "treelets/treelet_layout.h"

namespace shoal::testing {

struct TestTriangle {
  Vec3 p[3];
  uint32_t primitive = 0;
  bool operator==(const TestTriangle&) const = default;
};

inline Bounds3 bounds_of(const TestTriangle& t) {
  Bounds3 b;
  for (const Vec3& p : t.p) b.include(p);
  return b;
}
inline Bounds3 bounds_of(std::span<const TestTriangle> triangles) {
  Bounds3 b;
  for (const TestTriangle& t : triangles) b.include(bounds_of(t));
  return b;
}
inline float max_abs_of(const Bounds3& b) { return std::max(max_abs(&b.lo.x), max_abs(&b.hi.x)); }

/// A page of bytes aligned to 64 with 64 readable bytes after its end, as the page cache gives them.
class AlignedPage {
 public:
  explicit AlignedPage(std::span<const std::byte> bytes) : size_(bytes.size()), lines_((bytes.size() + 127) / 64) {
    if (size_ > 0) std::memcpy(lines_.data(), bytes.data(), size_);
  }
  std::span<const std::byte> bytes() const { return {reinterpret_cast<const std::byte*>(lines_.data()), size_}; }
  std::span<std::byte> mutable_bytes() { return {reinterpret_cast<std::byte*>(lines_.data()), size_}; }

 private:
  struct alignas(64) Line {
    std::byte bytes[64] = {};
  };
  size_t size_;
  std::vector<Line> lines_;
};

/// Splits [0, n) at the median of the centroids' longest axis into up to 8 parts.
inline std::vector<std::span<TestTriangle>> split_in_eight(std::span<TestTriangle> all, size_t leaf_size) {
  std::vector<std::span<TestTriangle>> parts{all};
  while (parts.size() < 8) {
    const auto largest = std::max_element(parts.begin(), parts.end(),
                                          [](const auto& a, const auto& b) { return a.size() < b.size(); });
    if (largest->size() <= leaf_size) break;
    const std::span<TestTriangle> part = *largest;
    const Vec3 e = bounds_of(part).extent();
    const int axis = e.x > e.y ? (e.x > e.z ? 0 : 2) : (e.y > e.z ? 1 : 2);
    const size_t half = part.size() / 2;
    std::nth_element(
        part.begin(), part.begin() + static_cast<long>(half), part.end(), [axis](const auto& a, const auto& b) {
          return a.p[0][axis] + a.p[1][axis] + a.p[2][axis] < b.p[0][axis] + b.p[1][axis] + b.p[2][axis];
        });
    *largest = part.first(half);
    parts.push_back(part.subspan(half));
  }
  return parts;
}

class PagePacker {
 public:
  explicit PagePacker(size_t leaf_size) : leaf_size_(leaf_size) {}

  /// Packs `triangles` and returns the root. Several roots may share the page.
  NodeRef add(std::span<TestTriangle> triangles) {
    if (triangles.size() <= leaf_size_) return add_leaf(triangles);
    const uint32_t index = static_cast<uint32_t>(nodes_.size());
    nodes_.push_back({});
    const auto parts = split_in_eight(triangles, leaf_size_);
    QuantizedNode node = quantize(parts);
    for (size_t slot = 0; slot < parts.size(); ++slot) node.child[slot] = add(parts[slot]);
    nodes_[index] = node;
    return index;
  }

  /// A chain of nodes, each with a leaf and the next node, and boxes as large as all of it. Requires: an empty page.
  void add_chain(std::span<TestTriangle> triangles) {
    for (size_t first = 0; first < triangles.size(); first += leaf_size_) {
      const std::span<TestTriangle> rest = triangles.subspan(first);
      const bool last = rest.size() <= leaf_size_;
      QuantizedNode node = quantize(last ? std::vector{triangles} : std::vector{triangles, triangles});
      node.child[0] = add_leaf(rest.first(std::min(leaf_size_, rest.size())));
      if (!last) node.child[1] = static_cast<uint32_t>(nodes_.size()) + 1;
      nodes_.push_back(node);
    }
  }

  /// Appends coverage: `record_of` a triangle's primitive (kNoIndex: opaque). Call before add().
  void set_coverage(std::vector<CoverageRecord> records, std::vector<uint8_t> texels,
                    std::function<uint32_t(uint32_t)> record_of) {
    records_ = std::move(records), texels_ = std::move(texels), record_of_ = std::move(record_of);
  }

  std::vector<std::byte> finish() const {
    TreeletHeader h{};
    h.magic = kTreeletMagic;
    h.node_count = static_cast<uint32_t>(nodes_.size());
    h.leaves_offset = static_cast<uint32_t>(sizeof h + nodes_.size() * sizeof(QuantizedNode));
    h.leaves_bytes = static_cast<uint32_t>(leaves_.size());
    h.triangle_count = static_cast<uint32_t>(primitives_.size());
    std::vector<std::byte> page;
    append(page, &h, 1);
    append(page, nodes_.data(), nodes_.size());
    append(page, leaves_.data(), leaves_.size());
    if (!record_of_) return page;
    h.coverage_offset = static_cast<uint32_t>(page.size());
    h.coverage_record_count = static_cast<uint32_t>(records_.size());
    h.coverage_texel_bytes = static_cast<uint32_t>(texels_.size());
    std::memcpy(page.data(), &h, sizeof h);
    for (const uint32_t primitive : primitives_) {
      const uint32_t record = record_of_(primitive);
      append(page, &record, 1);
    }
    append(page, records_.data(), records_.size());
    append(page, texels_.data(), texels_.size());
    return page;
  }

 private:
  template <class T>
  static void append(std::vector<std::byte>& out, const T* values, size_t count) {
    const size_t at = out.size();
    out.resize(at + count * sizeof(T));
    if (count > 0) std::memcpy(out.data() + at, values, count * sizeof(T));
  }

  NodeRef add_leaf(std::span<const TestTriangle> triangles) {
    const uint32_t offset = static_cast<uint32_t>(leaves_.size() / 4);
    std::vector<Vec3> vertices;
    std::vector<uint8_t> corner[3];
    LeafHeader header{};
    header.triangle_count = static_cast<uint8_t>(triangles.size());
    header.first_ordinal = static_cast<uint32_t>(primitives_.size());
    header.primitive_bytes = 4, header.flags = kLeafFloats;
    for (const TestTriangle& t : triangles) {
      for (int k = 0; k < 3; ++k) {
        const auto same_bits = [&](const Vec3& v) { return std::memcmp(&v, &t.p[k], sizeof v) == 0; };
        const auto found = std::find_if(vertices.begin(), vertices.end(), same_bits);
        corner[k].push_back(static_cast<uint8_t>(found - vertices.begin()));
        if (found == vertices.end()) vertices.push_back(t.p[k]);
      }
      primitives_.push_back(t.primitive);
      if (record_of_ && record_of_(t.primitive) != kNoIndex) header.flags |= kLeafCoverage;
    }
    header.vertex_count = static_cast<uint8_t>(vertices.size());
    append(leaves_, &header, 1);
    for (int axis = 0; axis < 3; ++axis) {
      for (const Vec3& v : vertices) append(leaves_, &v[axis], 1);
    }
    for (const auto& c : corner) append(leaves_, c.data(), c.size());
    for (int byte = 0; byte < 4; ++byte) {
      for (const TestTriangle& t : triangles) {
        const auto value = static_cast<uint8_t>(t.primitive >> (8 * byte));
        append(leaves_, &value, 1);
      }
    }
    leaves_.resize((leaves_.size() + 3) / 4 * 4);
    return kLeafBit | offset;
  }

  static QuantizedNode quantize(const std::vector<std::span<TestTriangle>>& parts) {
    QuantizedNode node{};
    node.child_count = static_cast<uint8_t>(parts.size());
    std::fill(std::begin(node.child), std::end(node.child), kEmptyRef);
    std::fill(&node.lo[0][0], &node.lo[0][0] + 24, uint8_t{255});
    Bounds3 all;
    for (const auto& part : parts) all.include(bounds_of(part));
    for (int axis = 0; axis < 3; ++axis) {
      node.origin[axis] = all.lo[axis];
      int e = -126;
      while (dequantize(all.lo[axis], std::ldexp(1.0f, e), 255) < all.hi[axis]) ++e;
      node.exponent[axis] = static_cast<int8_t>(e);
      for (size_t slot = 0; slot < parts.size(); ++slot) {
        const Bounds3 b = bounds_of(parts[slot]);
        uint8_t lo = 255, hi = 0;
        while (lo > 0 && dequantize(node.origin[axis], std::ldexp(1.0f, e), lo) > b.lo[axis]) --lo;
        while (hi < 255 && dequantize(node.origin[axis], std::ldexp(1.0f, e), hi) < b.hi[axis]) ++hi;
        node.lo[axis][slot] = lo, node.hi[axis][slot] = hi;
      }
    }
    return node;
  }

  size_t leaf_size_;
  std::vector<QuantizedNode> nodes_;
  std::vector<std::byte> leaves_;
  std::vector<uint32_t> primitives_;
  std::vector<CoverageRecord> records_;
  std::vector<uint8_t> texels_;
  std::function<uint32_t(uint32_t)> record_of_;
};

}  // namespace shoal::testing
