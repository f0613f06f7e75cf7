#include "tests/support/treelet_reader.h"

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "treelets/attribute_layout.h"

namespace shoal::testing {
namespace {

void expect(bool condition, const std::string& what) {
  if (!condition) throw std::runtime_error(what);
}

template <class T>
T read(const std::vector<std::byte>& page, size_t offset) {
  expect(offset + sizeof(T) <= page.size(), "read past the end of a page at " + std::to_string(offset));
  T value;
  std::memcpy(&value, page.data() + offset, sizeof(T));
  return value;
}

bool inside(const float p[9], const Bounds3& box) {
  for (int i = 0; i < 9; ++i) {
    if (!(box.lo[i % 3] <= p[i] && p[i] <= box.hi[i % 3])) return false;
  }
  return true;
}

class Reader {
 public:
  Reader(const BuiltObject& object, const std::vector<StoredTreelet>& treelets,
         const std::function<void(const ReadTriangle&)>& visit)
      : object_(object), treelets_(treelets), visit_(visit) {}

  ReadCounts read_all() {
    expect(!object_.nodes.empty(), "no root");
    entry_seen_.assign(object_.entries.size(), false);
    read_top(0, kNoIndex, 0);
    for (const bool seen : entry_seen_) expect(seen, "an entry that no node leads to");
    expect(counts_.top_nodes == object_.nodes.size(), "top nodes that nothing leads to");
    return counts_;
  }

 private:
  void read_top(uint32_t index, uint32_t parent, uint32_t level) {
    expect(index < object_.nodes.size(), "top node index out of range");
    const TopNode& node = object_.nodes[index];
    expect(node.parent == parent && node.level == level, "top node's parent or level is wrong");
    ++counts_.top_nodes;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      const Bounds3 box{{node.lo[0][slot], node.lo[1][slot], node.lo[2][slot]},
                        {node.hi[0][slot], node.hi[1][slot], node.hi[2][slot]}};
      if (node.kind[slot] == ChildKind::kEmpty) {
        expect(std::isinf(box.lo.x) && box.lo.x > 0 && std::isinf(box.hi.z) && box.hi.z < 0, "empty slot's box");
        continue;
      }
      boxes_.push_back(box);
      if (node.kind[slot] == ChildKind::kNode) {
        read_top(node.child[slot], index << 3 | slot, level + 1);
      } else {
        expect(node.kind[slot] == ChildKind::kEntry, "kind of a top node's child");
        read_entry(node.child[slot], level + 1);
      }
      boxes_.pop_back();
    }
  }

  void read_entry(uint32_t index, uint32_t top_depth) {
    expect(index < object_.entries.size() && !entry_seen_[index], "entry out of range or reached twice");
    entry_seen_[index] = true;
    ++counts_.entries;
    const TreeletEntry& entry = object_.entries[index];
    expect(entry.treelet < treelets_.size(), "treelet out of range");
    page_ = &treelets_[entry.treelet].geometry;
    attributes_ = &treelets_[entry.treelet].attributes;
    header_ = read<TreeletHeader>(*page_, 0);
    expect(header_.magic == kTreeletMagic, "magic of a geometry page");
    triangle_.treelet = entry.treelet;
    triangle_.top_depth = top_depth;
    read_ref(entry.root, 1);
  }

  void read_ref(NodeRef ref, uint32_t depth) {
    expect(depth <= kMaxTreeletDepth, "a treelet that is too deep");
    if (is_leaf(ref)) return read_leaf(leaf_offset(ref) * 4, depth);
    expect(ref < header_.node_count, "node out of range");
    const auto node = read<QuantizedNode>(*page_, sizeof(TreeletHeader) + size_t{ref} * sizeof(QuantizedNode));
    ++counts_.wide_nodes, counts_.wide_children += node.child_count;
    expect(node.child_count >= 2 && node.child_count <= 8, "child count");
    for (uint32_t slot = 0; slot < 8; ++slot) {
      Bounds3 box;
      for (int axis = 0; axis < 3; ++axis) {
        const float step = std::ldexp(1.0f, node.exponent[axis]);
        box.lo[axis] = node.origin[axis] + static_cast<float>(node.lo[axis][slot]) * step;
        box.hi[axis] = node.origin[axis] + static_cast<float>(node.hi[axis][slot]) * step;
        if (slot >= node.child_count) {
          expect(node.lo[axis][slot] == 255 && node.hi[axis][slot] == 0, "empty slot's planes");
        }
      }
      if (slot >= node.child_count) {
        expect(node.child[slot] == kEmptyRef, "empty slot's child");
        continue;
      }
      expect(is_leaf(node.child[slot]) || node.child[slot] > ref, "a child that comes before its parent");
      boxes_.push_back(box);
      read_ref(node.child[slot], depth + 1);
      boxes_.pop_back();
    }
  }

  void read_leaf(size_t offset, uint32_t depth) {
    ++counts_.leaves;
    const size_t at = header_.leaves_offset + offset;
    const auto leaf = read<LeafHeader>(*page_, at);
    expect(leaf.triangle_count >= 1 && leaf.triangle_count <= kMaxLeafTriangles, "triangles of a leaf");
    expect(leaf.vertex_count >= 3 && leaf.vertex_count <= kMaxLeafVertices, "vertices of a leaf");
    const size_t t_count = leaf.triangle_count, v_count = leaf.vertex_count;
    const bool floats = (leaf.flags & kLeafFloats) != 0, grid = (leaf.flags & kLeafGrid) != 0;
    counts_.grid_leaves += grid;
    size_t indices = at + sizeof leaf + 12 * v_count;
    if (!floats) {
      indices = at + sizeof leaf + 12 + (grid ? 3 : 6) * v_count;
      for (uint32_t axis = 0; axis < 3; ++axis) indices += (leaf.flags >> axis & 1) * v_count;
    }
    expect(!floats || (leaf.flags & (7 | kLeafGrid)) == 0, "high planes or a grid beside floats");
    const size_t primitives = indices + 3 * t_count;
    expect(primitives + leaf.primitive_bytes * t_count <= header_.leaves_offset + header_.leaves_bytes, "leaf's end");
    triangle_.depth = depth;
    bool covered = false;
    for (uint32_t t = 0; t < leaf.triangle_count; ++t) {
      for (uint32_t c = 0; c < 3; ++c) {
        const auto v = read<uint8_t>(*page_, indices + c * leaf.triangle_count + t);
        expect(v < leaf.vertex_count, "vertex index of a leaf");
        for (uint32_t axis = 0; axis < 3; ++axis) {
          triangle_.position[3 * c + axis] = read_coordinate(at, leaf, axis, v);
        }
      }
      for (const Bounds3& box : boxes_) expect(inside(triangle_.position, box), "a vertex outside a box above it");
      triangle_.primitive = leaf.first_primitive;
      for (uint32_t byte = 0; byte < leaf.primitive_bytes; ++byte) {
        triangle_.primitive += uint32_t{read<uint8_t>(*page_, primitives + byte * t_count + t)} << (8 * byte);
      }
      read_ordinal(leaf.first_ordinal + t);
      covered |= triangle_.coverage.has_value();
      visit_(triangle_);
    }
    expect(((leaf.flags & kLeafCoverage) != 0) == covered, "has_coverage of a leaf");
  }

  float read_coordinate(size_t at, const LeafHeader& leaf, uint32_t axis, size_t v) {
    const size_t v_count = leaf.vertex_count, positions = at + sizeof leaf;
    if ((leaf.flags & kLeafFloats) != 0) return read<float>(*page_, positions + 4 * (axis * v_count + v));
    uint32_t bits = read<uint32_t>(*page_, positions + 4 * size_t{axis});
    if ((leaf.flags & kLeafGrid) != 0) {
      int64_t steps = (int64_t{bits} - (bits >= 0x80000000u ? int64_t{1} << 32 : 0) - (bits & 255)) / 256;
      steps += read<uint8_t>(*page_, positions + 12 + axis * v_count + v);
      size_t plane = positions + 12 + 3 * v_count;
      for (uint32_t before = 0; before < axis; ++before) plane += (leaf.flags >> before & 1) * v_count;
      if ((leaf.flags >> axis & 1) != 0) steps += 256 * int64_t{read<uint8_t>(*page_, plane + v)};
      expect(std::abs(steps) < 1 << 24, "steps that a float cannot hold");
      return std::ldexp(static_cast<float>(steps), static_cast<int>(bits & 255) - 127);
    }
    bits += read<uint16_t>(*page_, positions + 12 + 2 * (axis * v_count + v));
    size_t plane = positions + 12 + 6 * v_count;
    for (uint32_t before = 0; before < axis; ++before) plane += (leaf.flags >> before & 1) * v_count;
    if ((leaf.flags >> axis & 1) != 0) bits += uint32_t{read<uint8_t>(*page_, plane + v)} << 16;
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  void read_ordinal(uint32_t ordinal) {
    expect(ordinal < header_.triangle_count, "ordinal out of range");
    triangle_.coverage.reset();
    triangle_.texels.clear();
    if (header_.coverage_offset != 0) read_coverage(ordinal);
    read_attributes(ordinal);
  }

  void read_coverage(uint32_t ordinal) {
    const size_t records = header_.coverage_offset + 4 * size_t{header_.triangle_count};
    const auto record = read<uint32_t>(*page_, header_.coverage_offset + 4 * size_t{ordinal});
    if (record == kNoIndex) return;
    expect(record < header_.coverage_record_count, "coverage record out of range");
    triangle_.coverage = read<CoverageRecord>(*page_, records + record * sizeof(CoverageRecord));
    const CoverageRecord& r = *triangle_.coverage;
    const size_t texels = records + header_.coverage_record_count * sizeof(CoverageRecord);
    expect(texels + header_.coverage_texel_bytes == page_->size(), "texels end with the page");
    expect(size_t{r.texel_offset} + size_t{r.crop_width} * r.crop_height <= header_.coverage_texel_bytes,
           "crop's end");
    const auto* begin = reinterpret_cast<const uint8_t*>(page_->data()) + texels + r.texel_offset;
    triangle_.texels.assign(begin, begin + size_t{r.crop_width} * r.crop_height);
  }

  void read_attributes(uint32_t ordinal) {
    for (FullCorner& corner : triangle_.corner) {
      corner.fill(0);
      for (int i = 7; i < 11; ++i) corner[i] = 1;  // colour
    }
    triangle_.material = header_.uniform_material;
    if (attributes_->empty()) {
      expect(header_.uniform_material != kNoIndex, "no material anywhere");
      return;
    }
    const auto h = read<AttributeHeader>(*attributes_, 0);
    expect(h.magic == kAttributeMagic && h.triangle_count == header_.triangle_count, "attribute header");
    expect(h.uniform_material == header_.uniform_material, "pages disagree about the material");
    if (h.uniform_material == kNoIndex) {
      triangle_.material = read<uint32_t>(*attributes_, h.materials_offset + 4 * size_t{ordinal});
    }
    if (h.vertex_count == 0) return;
    const size_t floats = (h.has_normal ? 3 : 0) + (h.has_tangent ? 4 : 0) + (h.has_color ? 4 : 0) + 2 * h.uv_count;
    for (uint32_t c = 0; c < 3; ++c) {
      const size_t i = 3 * size_t{ordinal} + c;
      const uint32_t v = h.index_bytes == 2 ? read<uint16_t>(*attributes_, h.indices_offset + 2 * i)
                                            : read<uint32_t>(*attributes_, h.indices_offset + 4 * i);
      expect(v < h.vertex_count, "attribute vertex out of range");
      size_t from = h.vertices_offset + 4 * floats * v;
      const auto take = [&](size_t to, size_t count) {
        for (size_t k = 0; k < count; ++k, from += 4) triangle_.corner[c][to + k] = read<float>(*attributes_, from);
      };
      if (h.has_normal) take(0, 3);
      if (h.has_tangent) take(3, 4);
      if (h.has_color) take(7, 4);
      take(11, 2 * size_t{h.uv_count});
    }
  }

  const BuiltObject& object_;
  const std::vector<StoredTreelet>& treelets_;
  const std::function<void(const ReadTriangle&)>& visit_;
  const std::vector<std::byte>* page_ = nullptr;
  const std::vector<std::byte>* attributes_ = nullptr;
  TreeletHeader header_{};
  std::vector<Bounds3> boxes_;
  std::vector<bool> entry_seen_;
  ReadTriangle triangle_{};
  ReadCounts counts_;
};

}  // namespace

ReadCounts read_object(const BuiltObject& object, const std::vector<StoredTreelet>& treelets,
                       const std::function<void(const ReadTriangle&)>& visit) {
  return Reader(object, treelets, visit).read_all();
}

}  // namespace shoal::testing
