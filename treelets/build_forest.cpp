#include "treelets/build_forest.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <memory>

#include "treelets/bvh_builder.h"
#include "treelets/collapse_top.h"
#include "treelets/collapse_wide.h"
#include "treelets/crop_coverage.h"
#include "treelets/cut_treelets.h"
#include "treelets/gather_leaf.h"
#include "treelets/pack_attributes.h"
#include "treelets/pack_treelet.h"
#include "treelets/treelet_view.h"
#include "treelets/triangle_refs.h"

namespace shoal {
namespace {

// References sorted by part, in the order of the soup within each; begin[p] is the first of part p.
RefArray make_refs_by_part(const TriangleSoup& soup, std::span<const uint32_t> part_of,
                           uint32_t part_count, std::vector<uint32_t>& begin) {
  begin.assign(part_count + 1, 0);
  for (size_t i = 0; i < soup.size(); ++i) begin[part_of[i] + 1] += !is_degenerate(&soup.positions[9 * i]);
  for (uint32_t p = 0; p < part_count; ++p) begin[p + 1] += begin[p];
  std::vector<uint32_t> next(begin.begin(), begin.end() - 1);
  RefArray array(begin[part_count]);
  const std::span<BuildRef> refs = array.refs();
  for (size_t i = 0; i < soup.size(); ++i) {
    const float* p = &soup.positions[9 * i];
    if (!is_degenerate(p)) refs[next[part_of[i]]++] = make_triangle_ref(p, static_cast<uint32_t>(i));
  }
  return array;
}

// The trees of all parts under nodes that join them, which only hold the array together: treelets are cut below.
class ForestTree {
 public:
  ForestTree(std::span<BuildRef> refs, std::span<const uint32_t> begin, BvhBuilder builder)
      : refs_(refs), begin_(begin), builder_(builder) {
    const auto parts = static_cast<uint32_t>(begin.size() - 1);
    roots_.resize(parts);
    if (parts == 1) {
      roots_[0] = 0;
      nodes_ = build_tree(builder, refs, {kMaxLeafTriangles});
      return;
    }
    nodes_.reserve(2 * refs.size());  // what is never written takes no memory
    nodes_.resize(1);
    join(0, 0, parts);
    for (uint32_t p = 0; p < parts; ++p) add_part(p);
    for (size_t i = 2 * size_t{parts} - 1; i-- > 0;) {
      if (is_join(static_cast<uint32_t>(i))) close_join(nodes_[i]);
    }
  }
  std::vector<BinaryNode>& nodes() { return nodes_; }
  const std::vector<uint32_t>& roots() const { return roots_; }

 private:
  bool is_join(uint32_t node) const { return nodes_[node].bytes == kJoin; }

  void join(uint32_t place, uint32_t first, uint32_t last) {
    if (last - first == 1) {
      roots_[first] = place;
      return;
    }
    const auto child = static_cast<uint32_t>(nodes_.size());
    nodes_[place].left = child;
    nodes_[place].bytes = kJoin;
    nodes_.resize(child + 2);
    const uint32_t middle = first + (last - first) / 2;
    join(child, first, middle);
    join(child + 1, middle, last);
  }

  void add_part(uint32_t p) {
    const std::vector<BinaryNode> tree =
        build_tree(builder_, refs_.subspan(begin_[p], begin_[p + 1] - begin_[p]), {kMaxLeafTriangles});
    const auto shift = static_cast<uint32_t>(nodes_.size() - 1);
    for (size_t i = 0; i < tree.size(); ++i) {
      BinaryNode node = tree[i];
      node.first += begin_[p];
      if (!node.leaf()) node.left += shift;
      if (i == 0) {
        nodes_[roots_[p]] = node;
      } else {
        nodes_.push_back(node);
      }
    }
  }

  void close_join(BinaryNode& node) {
    const BinaryNode &left = nodes_[node.left], &right = nodes_[node.left + 1];
    node.first = left.first;
    node.count = left.count + right.count;
    node.bytes = 0;
    for (int axis = 0; axis < 3; ++axis) {
      node.lo[axis] = std::min(left.lo[axis], right.lo[axis]);
      node.hi[axis] = std::max(left.hi[axis], right.hi[axis]);
    }
  }

  static constexpr uint32_t kJoin = 0xffffffffu;  // in BinaryNode::bytes, not yet used
  std::span<BuildRef> refs_;
  std::span<const uint32_t> begin_;
  BvhBuilder builder_;
  std::vector<BinaryNode> nodes_;
  std::vector<uint32_t> roots_;
};

// Orders the triangles of every leaf as they came, and fills BinaryNode::bytes.
void measure_leaves(const TriangleSoup& soup, std::span<uint32_t> order, std::span<BinaryNode> tree) {
  tbb::parallel_for(size_t{0}, tree.size(), [&](size_t i) {
    BinaryNode& node = tree[i];
    if (!node.leaf()) return;
    const std::span<uint32_t> triangles = order.subspan(node.first, node.count);
    std::sort(triangles.begin(), triangles.end());
    LeafVertices leaf;
    gather_leaf(soup, triangles, leaf);
    uint32_t primitives[kMaxLeafTriangles];
    for (size_t t = 0; t < triangles.size(); ++t) primitives[t] = soup.primitive[triangles[t]];
    node.bytes = LeafParts::of(plan_leaf(leaf, {primitives, triangles.size()})).padded_bytes();
  });
  for (size_t i = tree.size(); i-- > 0;) {  // children come after their parent
    if (tree[i].leaf()) continue;
    const uint64_t bytes = uint64_t{tree[tree[i].left].bytes} + tree[tree[i].left + 1].bytes;
    tree[i].bytes = static_cast<uint32_t>(std::min<uint64_t>(bytes, 0xffffffffu));
  }
}

struct FinishedTreelet {
  Status status;
  PackedTreelet packed;
  std::vector<std::byte> attributes;
};

// Packs pages in parallel and hands them to the sink in order; a bounded number is in flight.
class PagePipeline {
 public:
  PagePipeline(const TriangleSoup& soup, const CoverageCropper& cropper, std::span<const BinaryNode> tree,
               const WidePlan& plan, std::span<const uint32_t> order, const TreeletCut& cut, TreeletSink& sink,
               std::vector<TreeletEntry>& entries, ForestSums& sums)
      : soup_(soup),
        cropper_(cropper),
        tree_(tree),
        plan_(plan),
        order_(order),
        cut_(cut),
        sink_(sink),
        entries_(entries),
        sums_(sums) {}

  Status run(size_t most_in_flight) {
    size_t next_page = 0, next_added = 0;
    const size_t useful = 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency());
    const size_t in_flight = most_in_flight == 0 ? useful : std::min(useful, most_in_flight);
    const auto read = tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order,
                                                     [&](tbb::flow_control& control) -> size_t {
                                                       if (next_page == cut_.page_count() || failed_)
                                                         return control.stop(), 0;
                                                       return next_page++;
                                                     });
    const auto pack = tbb::make_filter<size_t, FinishedTreelet*>(
        tbb::filter_mode::parallel, [&](size_t page) { return new FinishedTreelet(pack_page(page)); });
    const auto add =
        tbb::make_filter<FinishedTreelet*, void>(tbb::filter_mode::serial_in_order, [&](FinishedTreelet* finished) {
          const std::unique_ptr<FinishedTreelet> owner(finished);
          if (status_.ok()) status_ = add_page(next_added++, *finished);
          if (!status_.ok()) failed_ = true;
        });
    tbb::parallel_pipeline(in_flight, read & pack & add);
    return std::move(status_);
  }

 private:
  FinishedTreelet pack_page(size_t page) const {
    FinishedTreelet finished;
    Result<PackedTreelet> packed = pack_treelet(tree_, plan_, order_, cut_.page_units(page), soup_, cropper_);
    if (!packed.ok()) {
      finished.status = std::move(packed).error();
      return finished;
    }
    finished.packed = std::move(packed).value();
    SHOAL_CHECK(finished.packed.geometry.size() == cut_.page_bytes[page]);
    finished.attributes = pack_attributes(finished.packed.triangles, soup_);
    return finished;
  }

  Status add_page(size_t page, const FinishedTreelet& finished) {
    SHOAL_RETURN_IF_ERROR(finished.status);
    SHOAL_ASSIGN_OR_RETURN(const TreeletId id, sink_.add(finished.packed.geometry, finished.attributes));
    SHOAL_CHECK(finished.packed.roots.size() == cut_.page_units(page).size());
    for (const NodeRef root : finished.packed.roots) entries_.push_back({id, root});
    sums_.leaves_count += finished.packed.leaves_count;
    sums_.area += finished.packed.node_area + finished.packed.leaf_area;
    return {};
  }

  const TriangleSoup& soup_;
  const CoverageCropper& cropper_;
  std::span<const BinaryNode> tree_;
  const WidePlan& plan_;
  std::span<const uint32_t> order_;
  const TreeletCut& cut_;
  TreeletSink& sink_;
  std::vector<TreeletEntry>& entries_;
  ForestSums& sums_;
  Status status_;
  std::atomic<bool> failed_ = false;
};

double top_area(std::span<const TopNode> nodes) {
  double area = 0;
  for (const TopNode& node : nodes) {
    Bounds3 box;
    for (int slot = 0; slot < 8; ++slot) {
      box.include(Bounds3{{node.lo[0][slot], node.lo[1][slot], node.lo[2][slot]},
                          {node.hi[0][slot], node.hi[1][slot], node.hi[2][slot]}});
    }
    area += half_area(&box.lo.x, &box.hi.x);
  }
  return area;
}

void keep_upper_trees(std::span<const BinaryNode> tree, std::span<const uint32_t> roots, const TreeletCut& cut,
                      uint32_t first_entry, UpperForest& forest) {
  std::vector<uint32_t> entry_of(tree.size(), kNoIndex);
  for (uint32_t i = 0; i < cut.unit_roots.size(); ++i) entry_of[cut.unit_roots[i]] = first_entry + i;
  for (const uint32_t root : roots) {
    const size_t place = forest.nodes.size();
    forest.roots.push_back(static_cast<uint32_t>(place));
    forest.nodes.resize(place + 1);
    copy_subtree(tree, root, forest.nodes, place, [&](uint32_t node) { return entry_of[node]; });
  }
}

}  // namespace

Status build_forest(TriangleSoup&& input, std::vector<uint32_t>&& parts, uint32_t part_count,
                    const BuildOptions& options, const CoverageSource* coverage, TreeletSink& sink,
                    UpperForest& forest, std::vector<TreeletEntry>& entries, ForestSums& sums) {
  const TriangleSoup soup = std::move(input);
  std::vector<uint32_t> part_of = std::move(parts);
  SHOAL_CHECK(soup.positions.size() == 9 * soup.size() && soup.material.size() == soup.size() &&
              soup.corners.size() == 3 * soup.layout.floats() * soup.size());
  SHOAL_CHECK(part_count > 0 && (part_of.empty() ? part_count == 1 : part_of.size() == soup.size()));
  std::vector<uint32_t> begin;
  RefArray refs;
  if (part_count == 1) {
    refs = make_refs(soup.positions);
    begin = {0, static_cast<uint32_t>(refs.size())};
  } else {
    refs = make_refs_by_part(soup, part_of, part_count, begin);
  }
  part_of = {};
  sums.triangles_count += refs.size();
  sums.degenerate_count += soup.size() - refs.size();
  if (refs.size() == 0) return {};

  ForestTree joined(refs.refs(), begin, options.builder);
  std::vector<BinaryNode>& tree = joined.nodes();
  std::vector<uint32_t> order(refs.size());
  tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) { order[i] = refs.refs()[i].id; });
  refs = RefArray();
  measure_leaves(soup, order, tree);
  const WidePlan plan(tree);
  const CoverageCropper cropper(soup, coverage);
  const TreeletCut cut = cut_treelets(tree, joined.roots(), plan, order, cropper, options.treelet_bytes);

  const auto first_entry = static_cast<uint32_t>(entries.size());
  PagePipeline pipeline(soup, cropper, tree, plan, order, cut, sink, entries, sums);
  SHOAL_RETURN_IF_ERROR(pipeline.run(options.pages_in_flight));
  keep_upper_trees(tree, joined.roots(), cut, first_entry, forest);
  return {};
}

uint64_t forest_bytes(uint64_t triangles, const CornerLayout& layout, BvhBuilder builder) {
  // Soup 44 and its corners, the part 4, the reference 32, its place in the order 4; two nodes a triangle at most. While
  // a tree is put together, nodes lie in pieces of 8192 triangles too, which go back to the system as they are copied
  // where they are larger than 128 KiB; where they are not, both take less than these 88 bytes.
  constexpr uint64_t kNodes = 2 * sizeof(BinaryNode) + 8;
  const uint64_t each = 9 * 4 + 4 + 4 + 12ull * layout.floats() + 4 + sizeof(BuildRef) + 4 + kNodes +
                        builder_scratch_bytes(builder);
  return triangles * each;
}

uint64_t page_in_flight_bytes(uint32_t treelet_bytes, const CornerLayout& layout, bool on_grid) {
  // The page, its nodes and its leaves while vectors grow to twice their size; then the corners of its triangles, of
  // which each takes 8 bytes of the page at least, or 7 on a grid (leaves of copies), with the table that finds equal ones.
  const uint64_t triangles = treelet_bytes / (on_grid ? 7 : 8);
  const uint64_t corner_bytes = layout.floats() == 0 ? 0 : 2 * 4ull * layout.floats() + 4 + 16;
  return 5ull * treelet_bytes + triangles * (8 + 3 * corner_bytes);
}

BuiltObject finish_object(std::span<const BinaryNode> upper, std::vector<TreeletEntry>&& entries,
                          const ForestSums& sums) {
  BuiltObject object;
  object.triangles_count = sums.triangles_count;
  object.degenerate_count = sums.degenerate_count;
  object.leaves_count = sums.leaves_count;
  if (upper.empty()) return object;
  object.entries = std::move(entries);
  std::vector<uint32_t> entry_of(upper.size());
  for (size_t i = 0; i < upper.size(); ++i) entry_of[i] = upper[i].leaf() ? upper[i].first : kNoIndex;
  object.nodes = collapse_top(upper, entry_of, ChildKind::kEntry);
  const BinaryNode& root = upper[0];
  object.bounds = {{root.lo[0], root.lo[1], root.lo[2]}, {root.hi[0], root.hi[1], root.hi[2]}};
  const double root_area = half_area(root);
  if (root_area > 0) object.sah_cost = (top_area(object.nodes) + sums.area) / root_area;
  return object;
}

}  // namespace shoal
