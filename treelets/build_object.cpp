#include "treelets/build_object.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "treelets/binned_sah.h"
#include "treelets/collapse_top.h"
#include "treelets/collapse_wide.h"
#include "treelets/crop_coverage.h"
#include "treelets/cut_treelets.h"
#include "treelets/gather_leaf.h"
#include "treelets/pack_attributes.h"
#include "treelets/pack_treelet.h"

namespace shoal {
namespace {

constexpr size_t kChunkTriangles = 1u << 14;
constexpr uint64_t kMaxObjectTriangles = (1ull << 31) - 1;

// Two corners with equal bits (zeros compared without sign), or a coordinate out of range or not a number.
bool degenerate(const float* p) {
  uint32_t bits[9];
  for (int i = 0; i < 9; ++i) {
    if (!(std::fabs(p[i]) <= kMaxCoordinate)) return true;
    bits[i] = std::bit_cast<uint32_t>(p[i] + 0.0f);  // -0 + 0 = +0
  }
  const auto equal = [&bits](int a, int b) { return std::equal(bits + 3 * a, bits + 3 * a + 3, bits + 3 * b); };
  return equal(0, 1) || equal(1, 2) || equal(2, 0);
}

BuildRef make_ref(const float* p, uint32_t triangle) {
  BuildRef ref{};
  ref.id = triangle;
  for (int axis = 0; axis < 3; ++axis) {
    // One zero only: the minimum of -0 and +0 would depend on their order.
    ref.lo[axis] = std::min({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
    ref.hi[axis] = std::max({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
  }
  return ref;
}

// References to the triangles that are stored, in the order of the soup.
std::vector<BuildRef> make_refs(const TriangleSoup& soup) {
  const size_t count = soup.size(), chunk_count = (count + kChunkTriangles - 1) / kChunkTriangles;
  std::vector<size_t> begin(chunk_count + 1, 0);
  const auto for_each_stored = [&](size_t chunk, auto visit) {
    const size_t end = std::min(count, (chunk + 1) * kChunkTriangles);
    for (size_t i = chunk * kChunkTriangles; i < end; ++i) {
      if (!degenerate(&soup.positions[9 * i])) visit(i);
    }
  };
  tbb::parallel_for(size_t{0}, chunk_count,
                    [&](size_t chunk) { for_each_stored(chunk, [&](size_t) { ++begin[chunk + 1]; }); });
  for (size_t chunk = 0; chunk < chunk_count; ++chunk) begin[chunk + 1] += begin[chunk];
  std::vector<BuildRef> refs(begin[chunk_count]);
  tbb::parallel_for(size_t{0}, chunk_count, [&](size_t chunk) {
    size_t next = begin[chunk];
    for_each_stored(chunk,
                    [&](size_t i) { refs[next++] = make_ref(&soup.positions[9 * i], static_cast<uint32_t>(i)); });
  });
  return refs;
}

// Orders the triangles of every leaf as they came, and fills BinaryNode::bytes.
void measure_leaves(const TriangleSoup& soup, std::span<uint32_t> order, std::span<BinaryNode> tree) {
  tbb::parallel_for(size_t{0}, tree.size(), [&](size_t i) {
    BinaryNode& node = tree[i];
    if (!node.leaf()) return;
    const std::span<uint32_t> triangles = order.subspan(node.first, node.count);
    std::sort(triangles.begin(), triangles.end());
    LeafVertices leaf;
    gather_leaf(soup.positions, triangles, leaf);
    node.bytes = leaf_bytes(leaf.triangle_count, leaf.vertex_count) + leaf.triangle_count * 4;
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
               BuiltObject& object)
      : soup_(soup),
        cropper_(cropper),
        tree_(tree),
        plan_(plan),
        order_(order),
        cut_(cut),
        sink_(sink),
        object_(object) {}

  Status run() {
    size_t next_page = 0, next_added = 0;
    const size_t in_flight = 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency());
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

  double area() const { return area_; }

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
    for (const NodeRef root : finished.packed.roots) object_.entries.push_back({id, root});
    object_.leaves_count += finished.packed.leaves_count;
    area_ += finished.packed.node_area + finished.packed.leaf_area;
    return {};
  }

  const TriangleSoup& soup_;
  const CoverageCropper& cropper_;
  std::span<const BinaryNode> tree_;
  const WidePlan& plan_;
  std::span<const uint32_t> order_;
  const TreeletCut& cut_;
  TreeletSink& sink_;
  BuiltObject& object_;
  Status status_;
  std::atomic<bool> failed_ = false;
  double area_ = 0;
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

}  // namespace

Result<BuiltObject> build_object(TriangleSoup&& input, const BuildOptions& options, const CoverageSource* coverage,
                                 TreeletSink& sink) {
  const TriangleSoup soup = std::move(input);
  SHOAL_CHECK(soup.positions.size() == 9 * soup.size() && soup.material.size() == soup.size() &&
              soup.corners.size() == 3 * soup.layout.floats() * soup.size());
  if (soup.size() > kMaxObjectTriangles) {
    return Error{ErrorCode::kInput,
                 fmt::format("an object of {} triangles: expected at most {}", soup.size(), kMaxObjectTriangles)};
  }
  if (options.treelet_bytes < kMinTreeletBytes || options.treelet_bytes > kMaxTreeletBytes) {
    return Error{ErrorCode::kUsage, fmt::format("treelet size of {} bytes: expected {} to {}",
                                                options.treelet_bytes, kMinTreeletBytes, kMaxTreeletBytes)};
  }
  BuiltObject object;
  std::vector<BuildRef> refs = make_refs(soup);
  object.triangles_count = refs.size();
  object.degenerate_count = soup.size() - refs.size();
  if (refs.empty()) return object;

  std::vector<BinaryNode> tree = build_binary_tree(refs, kMaxLeafTriangles);
  std::vector<uint32_t> order(refs.size());
  tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) { order[i] = refs[i].id; });
  refs = {};
  measure_leaves(soup, order, tree);
  const WidePlan plan(tree);
  const CoverageCropper cropper(soup, coverage);
  const TreeletCut cut = cut_treelets(tree, plan, order, cropper, options.treelet_bytes);

  PagePipeline pipeline(soup, cropper, tree, plan, order, cut, sink, object);
  SHOAL_RETURN_IF_ERROR(pipeline.run());
  std::vector<uint32_t> entry_of(tree.size(), kNoIndex);
  for (uint32_t i = 0; i < cut.unit_roots.size(); ++i) entry_of[cut.unit_roots[i]] = i;
  object.nodes = collapse_top(tree, entry_of, ChildKind::kEntry);
  const BinaryNode& root = tree[0];
  object.bounds = {{root.lo[0], root.lo[1], root.lo[2]}, {root.hi[0], root.hi[1], root.hi[2]}};
  const double root_area = half_area(root);
  if (root_area > 0) object.sah_cost = (top_area(object.nodes) + pipeline.area()) / root_area;
  return object;
}

}  // namespace shoal
