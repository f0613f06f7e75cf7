#include "bench/kd_tree.h"

#include <tbb/parallel_invoke.h>

#include <cmath>

#include "bench/kd_tree_build.h"

namespace shoal::bench {
namespace {

constexpr size_t kSerialRefs = 4096;  // below, a subtree is one task
constexpr int kMaxKdDepth = 64;

struct Subtree {
  std::vector<KdNode> nodes;
  std::vector<uint32_t> refs;
};

class KdBuilder {
 public:
  KdBuilder(const VisibleTriangles& triangles, int max_depth) : triangles_(triangles), max_depth_(max_depth) {}

  void build(const KdCell& cell, std::vector<KdRef>&& refs, int depth, Subtree& out) const {
    const KdSplit split = depth < max_depth_ && refs.size() > 1 ? find_split(cell, refs) : KdSplit{};
    const size_t place = out.nodes.size();
    out.nodes.emplace_back();
    if (split.axis < 0 || split.cost >= kKdTriangleCost * static_cast<double>(refs.size())) {
      out.nodes[place].count = static_cast<uint32_t>(refs.size());
      out.nodes[place].link = link(out.refs.size(), KdNode::kLeaf);
      for (const KdRef& ref : refs) out.refs.push_back(ref.triangle);
      return;
    }
    const bool parallel = refs.size() > kSerialRefs;
    std::vector<KdRef> left, right;
    cut_refs(triangles_, cell, split, std::move(refs), left, right);
    KdCell left_cell = cell, right_cell = cell;
    left_cell.hi[split.axis] = right_cell.lo[split.axis] = split.plane;
    Subtree other;
    if (parallel) {
      tbb::parallel_invoke([&] { build(left_cell, std::move(left), depth + 1, out); },
                           [&] { build(right_cell, std::move(right), depth + 1, other); });
    } else {
      build(left_cell, std::move(left), depth + 1, out);
    }
    out.nodes[place].split = split.plane;
    out.nodes[place].link = link(out.nodes.size(), static_cast<uint32_t>(split.axis));
    if (parallel) {
      append(std::move(other), out);
    } else {
      build(right_cell, std::move(right), depth + 1, out);
    }
  }

 private:
  static uint32_t link(size_t index, uint32_t low) {
    SHOAL_CHECK(index < 1u << 30);
    return static_cast<uint32_t>(index << 2) | low;
  }

  static void append(Subtree&& from, Subtree& to) {
    const size_t nodes = to.nodes.size(), refs = to.refs.size();
    for (KdNode node : from.nodes) {
      node.link = link(node.index() + (node.leaf() ? refs : nodes), node.link & 3);
      to.nodes.push_back(node);
    }
    to.refs.insert(to.refs.end(), from.refs.begin(), from.refs.end());
  }

  const VisibleTriangles& triangles_;
  int max_depth_;
};

/// A ray as it crosses cells: in double, and wider than the hits that the test accepts.
struct CellRay {
  double origin[3], inverse[3], pad;

  CellRay(const Ray& ray, double wider) : pad(wider) {
    constexpr double kStill =
        1e300;  // of an axis along which the ray stands still: a plane is never or always passed
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = ray.origin[axis];
      inverse[axis] = ray.direction[axis] != 0 ? 1.0 / ray.direction[axis] : kStill;
    }
  }
  bool negative(uint32_t axis) const { return inverse[axis] < 0; }
  /// When the ray reaches the plane moved towards it (sign -1) or away from it (sign 1).
  double reach(uint32_t axis, double plane, double sign) const {
    const double moved = negative(axis) ? plane - sign * pad : plane + sign * pad;
    return (moved - origin[axis]) * inverse[axis];
  }
};

}  // namespace

KdTree::KdTree(const VisibleTriangles& triangles) : triangles_(triangles) {
  std::vector<KdRef> refs(triangles.triangles.size());
  for (uint32_t i = 0; i < refs.size(); ++i) {
    Vec3 world[3];
    triangles.place(triangles.triangles[i], world);
    Bounds3 box;
    for (const Vec3& p : world) box.include(p);
    refs[i] = {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}, i};
  }
  const Bounds3& b = triangles.bounds;
  const KdCell cell{{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}};
  // As deep as is usual (Havran 2000): 8 + 1.3 log2 n.
  const int depth = 8 + static_cast<int>(1.3 * std::log2(static_cast<double>(std::max<size_t>(refs.size(), 2))));
  Subtree whole;
  KdBuilder(triangles, std::min(depth, kMaxKdDepth)).build(cell, std::move(refs), 0, whole);
  nodes_ = std::move(whole.nodes), refs_ = std::move(whole.refs);
  nodes_.shrink_to_fit(), refs_.shrink_to_fit();
}

void KdTree::trace(Ray& ray, KdCounts& counts) const {
  const CellRay cells(ray, triangles_.pad(ray.origin));
  double from = 0, to = ray.t;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const bool negative = cells.negative(axis);
    const float near = negative ? triangles_.bounds.hi[axis] : triangles_.bounds.lo[axis];
    const float far = negative ? triangles_.bounds.lo[axis] : triangles_.bounds.hi[axis];
    from = std::max(from, cells.reach(axis, near, -1)), to = std::min(to, cells.reach(axis, far, 1));
  }
  if (from > to) return;
  struct Waiting {
    uint32_t node;
    double from, to;
  };
  Waiting stack[kMaxKdDepth + 1];
  int waiting = 0;
  uint32_t index = 0;
  RayContext context;
  for (;;) {
    const KdNode& node = nodes_[index];
    ++counts.node_steps;
    if (!node.leaf()) {
      const uint32_t axis = node.axis();
      const bool negative = cells.negative(axis);
      const uint32_t near = negative ? node.index() : index + 1, far = negative ? index + 1 : node.index();
      const double near_ends = cells.reach(axis, node.split, 1), far_begins = cells.reach(axis, node.split, -1);
      const bool visit_near = near_ends >= from, visit_far = far_begins <= to;
      if (visit_near) {
        if (visit_far) stack[waiting++] = {far, std::max(from, far_begins), to};
        to = std::min(to, near_ends);
        index = near;
        continue;
      }
      from = std::max(from, far_begins);
      index = far;
      continue;
    }
    for (uint32_t i = 0; i < node.count; ++i) {
      const VisibleTriangle& triangle = triangles_.triangles[refs_[node.index() + i]];
      ray.instance = triangle.instance;
      test_visible(triangle, context.object_space(ray, triangles_.tree->instance(triangle.instance)), ray);
    }
    counts.triangle_tests += node.count;
    do {
      if (waiting == 0) return;
      --waiting;
    } while (stack[waiting].from > ray.t);
    index = stack[waiting].node, from = stack[waiting].from, to = stack[waiting].to;
  }
}

}  // namespace shoal::bench
