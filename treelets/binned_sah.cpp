#include "treelets/binned_sah.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "io/result.h"
#include "treelets/partition_refs.h"
#include "treelets/sah_bins.h"

namespace shoal {
namespace {

// Below this count a subtree is one task (it fits the L2 cache and costs about a millisecond).
constexpr uint32_t kSerialCount = 8192;

struct Range {
  uint32_t begin, end, depth;
  LaneBox box;        // of the references
  LaneBox centroids;  // of binning_centroid() of the references

  uint32_t count() const { return end - begin; }
};

BinaryNode make_node(const Range& range) {
  const Bounds3 b = range.box.bounds();
  return {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}, range.begin, range.count(), kNoIndex, 0};
}

// A subtree as it is built: either two fragments, or a run of nodes built by one task (nodes[0] is its root).
struct Fragment {
  BinaryNode node;
  std::unique_ptr<Fragment> left, right;
  std::vector<BinaryNode> nodes;
};

class TreeBuilder {
 public:
  TreeBuilder(std::span<BuildRef> refs, const SahModel& model) : refs_(refs), model_(model) {}

  std::vector<BinaryNode> build() {
    Range root{0, static_cast<uint32_t>(refs_.size()), 0, {}, {}};
    measure(root);
    const std::unique_ptr<Fragment> fragment = build_fragment(root);
    // Grows into what was reserved while fragments are freed: the nodes are not there twice.
    const size_t count = count_nodes(*fragment);
    std::vector<BinaryNode> nodes;
    nodes.reserve(count);
    nodes.resize(1);
    flatten(*fragment, 0, nodes);
    SHOAL_CHECK(count == nodes.size());
    return nodes;
  }

 private:
  uint64_t test_count(uint64_t count) const { return (count + model_.block - 1) / model_.block; }
  uint64_t blocks(uint64_t count) const { return (count + model_.leaf_size - 1) / model_.leaf_size; }

  void measure(Range& range) const {
    measure_refs(refs_.subspan(range.begin, range.count()), range.box, range.centroids);
  }

  // True when nothing deeper may depend on where the geometry lies: halving by count must begin here.
  bool must_halve(const Range& range) const {
    return range.depth + std::bit_width(blocks(range.count()) - 1) >= kMaxBinaryDepth;
  }

  // Splits into left and right, or returns false: the range is a leaf.
  bool split(const Range& range, Range& left, Range& right) {
    const uint32_t n = range.count();
    const bool may_be_leaf = n <= model_.leaf_size;
    if (n == 1 || (may_be_leaf && range.depth >= kMaxBinaryDepth)) return false;
    if (!may_be_leaf && must_halve(range)) return halve(range, true, left, right), true;

    const Binning binning(range.centroids, n);
    if (!binning.any_axis()) return may_be_leaf ? false : (halve(range, false, left, right), true);
    const std::span<BuildRef> refs = refs_.subspan(range.begin, n);
    SahBins bins(binning.bin_count());
    fill_bins(refs, binning, bins);
    const SahSplit best = bins.best_split(range.box, model_.block);
    if (may_be_leaf) {
      const double area = half_area(range.box), leaf_cost = area * static_cast<double>(test_count(n));
      if (!best.found() || model_.split_cost * area + best.cost >= leaf_cost) return false;
    } else if (!best.found()) {
      return halve(range, true, left, right), true;
    }
    left = {range.begin, 0, range.depth + 1, {}, {}};
    right = {0, range.end, range.depth + 1, {}, {}};
    bins.child_boxes(best, left.box, right.box);
    const size_t left_count = partition_refs(refs, binning, best, left.centroids, right.centroids);
    left.end = right.begin = range.begin + static_cast<uint32_t>(left_count);
    SHOAL_CHECK(left.begin < left.end && right.begin < right.end);
    return true;
  }

  // Halves by count, in whole leaves; `ordered`: by centroid along the widest axis, else as they lie.
  void halve(const Range& range, bool ordered, Range& left, Range& right) {
    const uint32_t left_count = static_cast<uint32_t>((blocks(range.count()) + 1) / 2 * model_.leaf_size);
    const uint32_t middle = range.begin + left_count;
    if (ordered) order_by_centroid(refs_.subspan(range.begin, range.count()), left_count, range.centroids);
    left = {range.begin, middle, range.depth + 1, {}, {}};
    right = {middle, range.end, range.depth + 1, {}, {}};
    measure(left), measure(right);
  }

  void build_serial(const Range& range, size_t index, std::vector<BinaryNode>& nodes) {
    nodes[index] = make_node(range);
    Range left, right;
    if (!split(range, left, right)) return;
    const size_t child = nodes.size();
    nodes[index].left = static_cast<uint32_t>(child);
    nodes.resize(child + 2);
    build_serial(left, child, nodes);
    build_serial(right, child + 1, nodes);
  }

  std::unique_ptr<Fragment> build_fragment(const Range& range) {
    auto fragment = std::make_unique<Fragment>();
    Range left, right;
    if (range.count() <= kSerialCount) {
      fragment->nodes.reserve(range.count() / 2 + 1);
      fragment->nodes.resize(1);
      build_serial(range, 0, fragment->nodes);
      fragment->nodes.shrink_to_fit();
    } else if (split(range, left, right)) {
      fragment->node = make_node(range);
      tbb::parallel_invoke([&] { fragment->left = build_fragment(left); },
                           [&] { fragment->right = build_fragment(right); });
    } else {
      fragment->nodes.push_back(make_node(range));
    }
    return fragment;
  }

  static size_t count_nodes(const Fragment& f) {
    return f.left ? 1 + count_nodes(*f.left) + count_nodes(*f.right) : f.nodes.size();
  }

  // Writes the fragment's root at `index` and everything below at the end.
  static void flatten(Fragment& f, uint32_t index, std::vector<BinaryNode>& nodes) {
    if (f.left) {
      nodes[index] = f.node;
      const auto child = static_cast<uint32_t>(nodes.size());
      nodes[index].left = child;
      nodes.resize(nodes.size() + 2);
      flatten(*f.left, child, nodes);
      f.left.reset();
      flatten(*f.right, child + 1, nodes);
      f.right.reset();
      return;
    }
    const auto shift = static_cast<uint32_t>(nodes.size() - 1);  // nodes[1] of the run comes next
    for (size_t i = 0; i < f.nodes.size(); ++i) {
      BinaryNode node = f.nodes[i];
      if (!node.leaf()) node.left += shift;
      if (i == 0) {
        nodes[index] = node;
      } else {
        nodes.push_back(node);
      }
    }
    f.nodes = {};
  }

  std::span<BuildRef> refs_;
  SahModel model_;
};

}  // namespace

std::vector<BinaryNode> build_binary_tree(std::span<BuildRef> refs, const SahModel& model) {
  SHOAL_CHECK(!refs.empty() && refs.size() < (1u << 31) && model.leaf_size > 0 && std::has_single_bit(model.block));
  return TreeBuilder(refs, model).build();
}

}  // namespace shoal
