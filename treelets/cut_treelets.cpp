#include "treelets/cut_treelets.h"

#include "treelets/treelet_layout.h"

namespace shoal {
namespace {

// Adds up a geometry page as units join it.
class PageSize {
 public:
  PageSize(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const uint32_t> order,
           const CoverageCropper& cropper, uint64_t limit_bytes)
      : tree_(tree), plan_(plan), order_(order), cropper_(cropper), limit_bytes_(limit_bytes) {}

  void clear() { plain_bytes_ = sizeof(TreeletHeader), triangle_count_ = record_count_ = 0, crops_.clear(); }

  uint64_t bytes() const {
    const uint64_t coverage =
        record_count_ == 0
            ? 0
            : triangle_count_ * sizeof(uint32_t) + record_count_ * sizeof(CoverageRecord) + crops_.texel_bytes();
    return plain_bytes_ + coverage;
  }

  /// False as soon as the page is known to pass the limit; it is then in no useful state.
  bool add(uint32_t root) {
    const BinaryNode& node = tree_[root];
    if (plain_bytes_ + node.bytes > limit_bytes_) return false;
    add_unlimited_plain(root);
    if (bytes() > limit_bytes_) return false;
    if (!cropper_.any()) return true;
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      add_coverage(order_[i]);
      if (bytes() > limit_bytes_) return false;
    }
    return true;
  }

  void add_unlimited(uint32_t root) {
    add_unlimited_plain(root);
    const BinaryNode& node = tree_[root];
    for (uint32_t i = node.first; cropper_.any() && i < node.first + node.count; ++i) add_coverage(order_[i]);
  }

 private:
  void add_unlimited_plain(uint32_t root) {
    plain_bytes_ += tree_[root].bytes + uint64_t{plan_.count_nodes(root)} * sizeof(QuantizedNode);
    triangle_count_ += tree_[root].count;
  }
  void add_coverage(uint32_t triangle) {
    const std::optional<CoveragePlan> plan = cropper_.plan(triangle);
    if (!plan) return;
    ++record_count_;
    if (plan->crop.width != 0) crops_.add(plan->crop);
  }

  std::span<const BinaryNode> tree_;
  const WidePlan& plan_;
  std::span<const uint32_t> order_;
  const CoverageCropper& cropper_;
  uint64_t limit_bytes_;
  uint64_t plain_bytes_ = sizeof(TreeletHeader), triangle_count_ = 0, record_count_ = 0;
  CropSet crops_;
};

void find_units(std::span<const BinaryNode> tree, uint32_t root, PageSize& size, std::vector<uint32_t>& units) {
  size.clear();
  if (tree[root].leaf() || size.add(root)) {
    units.push_back(root);
    return;
  }
  find_units(tree, tree[root].left, size, units);
  find_units(tree, tree[root].left + 1, size, units);
}

}  // namespace

TreeletCut cut_treelets(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const uint32_t> order,
                        const CoverageCropper& cropper, uint32_t treelet_bytes) {
  TreeletCut cut;
  PageSize size(tree, plan, order, cropper, treelet_bytes);
  find_units(tree, 0, size, cut.unit_roots);

  size.clear();
  cut.page_begin.push_back(0);
  uint64_t page_bytes = 0;
  for (uint32_t i = 0; i < cut.unit_roots.size(); ++i) {
    const bool first = i == cut.page_begin.back();
    if (first || !size.add(cut.unit_roots[i])) {
      if (!first) {
        cut.page_bytes.push_back(static_cast<uint32_t>(page_bytes));
        cut.page_begin.push_back(i);
      }
      size.clear();
      size.add_unlimited(cut.unit_roots[i]);
    }
    page_bytes = size.bytes();
  }
  cut.page_bytes.push_back(static_cast<uint32_t>(page_bytes));
  cut.page_begin.push_back(static_cast<uint32_t>(cut.unit_roots.size()));
  return cut;
}

}  // namespace shoal
