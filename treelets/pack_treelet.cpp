#include "treelets/pack_treelet.h"

#include <cstring>

#include "treelets/gather_leaf.h"
#include "treelets/quantize_boxes.h"

namespace shoal {
namespace {

template <class T>
void append(std::vector<std::byte>& bytes, std::span<const T> values) {
  const auto* begin = reinterpret_cast<const std::byte*>(values.data());
  bytes.insert(bytes.end(), begin, begin + values.size_bytes());
}

class Packer {
 public:
  Packer(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const uint32_t> order,
         const TriangleSoup& soup, const CoverageCropper& cropper, PackedTreelet& out)
      : tree_(tree), plan_(plan), order_(order), soup_(soup), cropper_(cropper), out_(out) {}

  Status pack(std::span<const uint32_t> unit_roots) {
    for (const uint32_t root : unit_roots) out_.roots.push_back(add_subtree(root));
    TreeletHeader header{};
    header.magic = kTreeletMagic;
    header.node_count = static_cast<uint32_t>(nodes_.size());
    header.leaves_offset = static_cast<uint32_t>(sizeof header + nodes_.size() * sizeof(QuantizedNode));
    header.leaves_bytes = static_cast<uint32_t>(leaves_.size());
    header.triangle_count = static_cast<uint32_t>(out_.triangles.size());
    header.uniform_material = uniform_material();
    if (!records_.empty()) {
      header.coverage_offset = header.leaves_offset + header.leaves_bytes;
      header.coverage_record_count = static_cast<uint32_t>(records_.size());
      header.coverage_texel_bytes = static_cast<uint32_t>(crops_.texel_bytes());
    }
    std::vector<std::byte>& page = out_.geometry;
    page.reserve(header.leaves_offset + header.leaves_bytes + record_of_.size() * sizeof(uint32_t) +
                 records_.size() * sizeof(CoverageRecord) + crops_.texel_bytes());
    append(page, std::span<const TreeletHeader>(&header, 1));
    append<QuantizedNode>(page, nodes_);
    append<std::byte>(page, leaves_);
    return records_.empty() ? Status() : append_coverage();
  }

 private:
  NodeRef add_subtree(uint32_t root) {
    if (tree_[root].leaf()) return add_leaf(tree_[root]);
    const WideChildren children = plan_.children(root);
    const size_t index = nodes_.size();
    nodes_.emplace_back();
    out_.node_area += half_area(tree_[root]);
    Bounds3 boxes[8];
    for (uint32_t i = 0; i < children.count; ++i) {
      const BinaryNode& child = tree_[children.node[i]];
      boxes[i] = {{child.lo[0], child.lo[1], child.lo[2]}, {child.hi[0], child.hi[1], child.hi[2]}};
    }
    QuantizedNode node{};
    quantize_boxes({boxes, children.count}, node);
    for (uint32_t i = 0; i < 8; ++i) {
      node.child[i] = i < children.count ? add_subtree(children.node[i]) : kEmptyRef;
    }
    nodes_[index] = node;
    return static_cast<NodeRef>(index);
  }

  NodeRef add_leaf(const BinaryNode& node) {
    const std::span<const uint32_t> triangles = order_.subspan(node.first, node.count);
    gather_leaf(soup_, triangles, leaf_);
    out_.leaf_area += half_area(node);
    ++out_.leaves_count;
    primitives_.clear();
    for (const uint32_t triangle : triangles) primitives_.push_back(soup_.primitive[triangle]);
    LeafHeader header = plan_leaf(leaf_, primitives_);
    header.first_ordinal = static_cast<uint32_t>(out_.triangles.size());
    for (const uint32_t triangle : triangles) header.flags |= add_triangle(triangle);
    const size_t offset = leaves_.size();
    append_leaf(leaf_, header, primitives_, leaves_);
    return kLeafBit | static_cast<NodeRef>(offset / 4);
  }

  // Returns kLeafCoverage when the triangle has a coverage record.
  uint8_t add_triangle(uint32_t triangle) {
    out_.triangles.push_back(triangle);
    if (!cropper_.any()) return 0;
    std::optional<CoveragePlan> plan = cropper_.plan(triangle);
    record_of_.push_back(plan ? static_cast<uint32_t>(records_.size()) : kNoIndex);
    if (!plan) return 0;
    if (plan->crop.width != 0) plan->record.texel_offset = crops_.add(plan->crop);
    records_.push_back(plan->record);
    return kLeafCoverage;
  }

  uint32_t uniform_material() const {
    const uint32_t material = soup_.material[out_.triangles[0]];
    for (const uint32_t triangle : out_.triangles) {
      if (soup_.material[triangle] != material) return kNoIndex;
    }
    return material;
  }

  Status append_coverage() {
    std::vector<std::byte>& page = out_.geometry;
    append<uint32_t>(page, record_of_);
    append<CoverageRecord>(page, records_);
    size_t offset = page.size();
    page.resize(offset + crops_.texel_bytes());
    for (const CropKey& key : crops_.keys()) {
      const size_t bytes = key.texel_bytes();
      SHOAL_RETURN_IF_ERROR(cropper_.read_crop(key, {reinterpret_cast<uint8_t*>(&page[offset]), bytes}));
      offset += bytes;
    }
    return {};
  }

  std::span<const BinaryNode> tree_;
  const WidePlan& plan_;
  std::span<const uint32_t> order_;
  const TriangleSoup& soup_;
  const CoverageCropper& cropper_;
  PackedTreelet& out_;
  std::vector<QuantizedNode> nodes_;
  std::vector<std::byte> leaves_;
  std::vector<uint32_t> record_of_;
  std::vector<CoverageRecord> records_;
  CropSet crops_;
  LeafVertices leaf_;
  std::vector<uint32_t> primitives_;  ///< of the leaf
};

}  // namespace

Result<PackedTreelet> pack_treelet(std::span<const BinaryNode> tree, const WidePlan& plan,
                                   std::span<const uint32_t> order, std::span<const uint32_t> unit_roots,
                                   const TriangleSoup& soup, const CoverageCropper& cropper) {
  PackedTreelet packed;
  SHOAL_RETURN_IF_ERROR(Packer(tree, plan, order, soup, cropper, packed).pack(unit_roots));
  return packed;
}

}  // namespace shoal
