#include "treelets/cut_treelets.h"

#include "treelets/treelet_layout.h"

namespace shoal {
namespace {

// A page fuller than this is closed when the next subtree does not fit; an emptier one takes a part of it.
constexpr double kWellFilled = 0.6;
// How far down the left side of that subtree a part is looked for: each level may add one more root to enter.
constexpr int kMaxPartLevels = 2;

// Adds up a geometry page as units join it.
class PageSize {
 public:
  PageSize(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const uint32_t> order,
           const CoverageCropper& cropper, uint64_t limit_bytes)
      : tree_(tree), plan_(plan), order_(order), cropper_(cropper), limit_bytes_(limit_bytes) {}

  void clear() { sums_ = {}, crops_.clear(); }

  uint64_t bytes() const {
    const uint64_t coverage = sums_.record_count == 0
                                  ? 0
                                  : sums_.triangle_count * sizeof(uint32_t) +
                                        sums_.record_count * sizeof(CoverageRecord) + crops_.texel_bytes();
    return sums_.plain_bytes + coverage;
  }

  /// Adds a unit if the page then stays within the limit; an only unit that is one leaf always fits.
  bool add(uint32_t root) {
    const BinaryNode& node = tree_[root];
    const uint64_t limit_bytes = sums_.triangle_count == 0 && node.leaf() ? UINT64_MAX : limit_bytes_;
    if (sums_.plain_bytes + node.bytes > limit_bytes) return false;
    const Sums before = sums_;
    const size_t crops_before = crops_.keys().size();
    sums_.plain_bytes += node.bytes + uint64_t{plan_.count_nodes(root)} * sizeof(QuantizedNode);
    sums_.triangle_count += node.count;
    bool fits = bytes() <= limit_bytes;
    for (uint32_t i = 0; cropper_.any() && fits && i < node.count; ++i) {
      add_coverage(order_[node.first + i]);
      fits = bytes() <= limit_bytes;
    }
    if (!fits) sums_ = before, crops_.truncate(crops_before);
    return fits;
  }

 private:
  struct Sums {
    uint64_t plain_bytes = sizeof(TreeletHeader), triangle_count = 0, record_count = 0;
  };

  void add_coverage(uint32_t triangle) {
    const std::optional<CoveragePlan> plan = cropper_.plan(triangle);
    if (!plan) return;
    ++sums_.record_count;
    if (plan->crop.width != 0) crops_.add(plan->crop);
  }

  std::span<const BinaryNode> tree_;
  const WidePlan& plan_;
  std::span<const uint32_t> order_;
  const CoverageCropper& cropper_;
  uint64_t limit_bytes_;
  Sums sums_;
  CropSet crops_;
};

class Cutter {
 public:
  Cutter(std::span<const BinaryNode> tree, uint32_t treelet_bytes, PageSize& page)
      : tree_(tree), well_filled_bytes_(static_cast<uint64_t>(kWellFilled * treelet_bytes)), page_(page) {}

  TreeletCut cut(std::span<const uint32_t> starts) {
    cut_.page_begin.push_back(0);
    waiting_.assign(starts.rbegin(), starts.rend());
    while (!waiting_.empty()) {
      const uint32_t root = waiting_.back();
      if (page_.add(root)) {
        waiting_.pop_back();
        cut_.unit_roots.push_back(root);
      } else if (page_is_empty()) {
        open_last();
      } else if (page_.bytes() >= well_filled_bytes_ || !add_part(root)) {
        close_page();
      }
    }
    close_page();
    return std::move(cut_);
  }

 private:
  bool page_is_empty() const { return cut_.unit_roots.size() == cut_.page_begin.back(); }

  void close_page() {
    cut_.page_bytes.push_back(static_cast<uint32_t>(page_.bytes()));
    cut_.page_begin.push_back(static_cast<uint32_t>(cut_.unit_roots.size()));
    page_.clear();
  }

  // Replaces the node that is next by its children, left one next.
  void open_last() {
    const uint32_t left = tree_[waiting_.back()].left;
    waiting_.back() = left + 1;
    waiting_.push_back(left);
  }

  // Tops the page up with the first part of the next subtree that fits and is worth a root of its own.
  bool add_part(uint32_t root) {
    uint32_t part = root;
    for (int level = 1; level <= kMaxPartLevels && !tree_[part].leaf(); ++level) {
      part = tree_[part].left;
      if (!page_.add(part)) continue;
      for (; level > 0; --level) open_last();
      waiting_.pop_back();
      cut_.unit_roots.push_back(part);
      return true;
    }
    return false;
  }

  std::span<const BinaryNode> tree_;
  uint64_t well_filled_bytes_;
  PageSize& page_;
  std::vector<uint32_t> waiting_;  // subtrees still to be placed, the next one last
  TreeletCut cut_;
};

}  // namespace

TreeletCut cut_treelets(std::span<const BinaryNode> tree, std::span<const uint32_t> starts, const WidePlan& plan,
                        std::span<const uint32_t> order, const CoverageCropper& cropper, uint32_t treelet_bytes) {
  PageSize page(tree, plan, order, cropper, treelet_bytes);
  return Cutter(tree, treelet_bytes, page).cut(starts);
}

}  // namespace shoal
