#include "bench/kd_tree_build.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace shoal::bench {
namespace {

constexpr int kBins = 128;

/// Areas of the sides for any plane of one axis.
class PlaneCost {
 public:
  PlaneCost(const KdCell& cell, int axis, size_t refs) : lo_(cell.lo[axis]), hi_(cell.hi[axis]), refs_(refs) {
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const double wide_a = static_cast<double>(cell.hi[a]) - cell.lo[a];
    const double wide_b = static_cast<double>(cell.hi[b]) - cell.lo[b];
    end_ = wide_a * wide_b, around_ = wide_a + wide_b;
    const double whole = end_ + (hi_ - lo_) * around_;
    per_area_ = whole > 0 ? 1 / whole : 0;
  }
  bool inside(double plane) const { return plane > lo_ && plane < hi_; }

  /// Takes the plane into `best` if it is cheaper.
  void consider(double plane, size_t left, size_t planar, size_t right, int axis, KdSplit& best) const {
    for (const bool planar_left : {true, false}) {
      const size_t lefts = left + (planar_left ? planar : 0), rights = right + (planar_left ? 0 : planar);
      const double share_left = (end_ + (plane - lo_) * around_) * per_area_;
      const double share_right = (end_ + (hi_ - plane) * around_) * per_area_;
      const double bonus = lefts == 0 || rights == 0 ? kKdEmptyBonus : 1;
      const double cost =
          bonus * (kKdTraversalCost + kKdTriangleCost * (share_left * static_cast<double>(lefts) +
                                                         share_right * static_cast<double>(rights)));
      if (best.axis < 0 || cost < best.cost) best = {cost, axis, static_cast<float>(plane), planar_left};
      if (planar == 0) break;
    }
  }
  size_t refs() const { return refs_; }

 private:
  double lo_, hi_, end_, around_, per_area_;
  size_t refs_;
};

struct Event {
  enum Kind : uint32_t { kEnd, kPlanar, kStart };
  float plane;
  uint32_t kind;
  bool operator<(const Event& other) const {
    return plane != other.plane ? plane < other.plane : kind < other.kind;
  }
};

void sweep(const PlaneCost& cost, int axis, const std::vector<KdRef>& refs, std::vector<Event>& events,
           KdSplit& best) {
  events.clear();
  for (const KdRef& ref : refs) {
    if (ref.lo[axis] == ref.hi[axis]) {
      events.push_back({ref.lo[axis], Event::kPlanar});
    } else {
      events.push_back({ref.lo[axis], Event::kStart});
      events.push_back({ref.hi[axis], Event::kEnd});
    }
  }
  std::sort(events.begin(), events.end());
  size_t left = 0, right = refs.size();
  for (size_t i = 0; i < events.size();) {
    const float plane = events[i].plane;
    size_t count[3] = {};
    for (; i < events.size() && events[i].plane == plane; ++i) ++count[events[i].kind];
    right -= count[Event::kEnd] + count[Event::kPlanar];
    if (cost.inside(plane)) cost.consider(plane, left, count[Event::kPlanar], right, axis, best);
    left += count[Event::kStart] + count[Event::kPlanar];
  }
}

void try_bins(const PlaneCost& cost, const KdCell& cell, int axis, const std::vector<KdRef>& refs, KdSplit& best) {
  const double lo = cell.lo[axis], width = (static_cast<double>(cell.hi[axis]) - lo) / kBins;
  if (!(width > 0)) return;
  size_t starts[kBins] = {}, ends[kBins] = {};
  const auto bin = [&](float at) { return std::clamp(static_cast<int>((at - lo) / width), 0, kBins - 1); };
  for (const KdRef& ref : refs) ++starts[bin(ref.lo[axis])], ++ends[bin(ref.hi[axis])];
  size_t left = 0, right = refs.size();
  for (int i = 1; i < kBins; ++i) {
    left += starts[i - 1], right -= ends[i - 1];
    const auto plane = static_cast<float>(lo + i * width);
    if (cost.inside(plane)) cost.consider(plane, left, 0, right, axis, best);
  }
}

/// A triangle cut by planes along the axes: at most three corners and one for each plane.
struct Polygon {
  double p[16][3];  // nine, and room for what rounding may add
  int count = 0;
};

/// What of `from` lies where (x - plane) * sign >= 0 (Sutherland and Hodgman 1974).
Polygon clip(const Polygon& from, int axis, double plane, double sign) {
  Polygon to;
  for (int i = 0; i < from.count; ++i) {
    const double* a = from.p[i];
    const double* b = from.p[(i + 1) % from.count];
    const double da = (a[axis] - plane) * sign, db = (b[axis] - plane) * sign;
    if (da >= 0) std::copy_n(a, 3, to.p[to.count++]);
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
      double* q = to.p[to.count++];
      const double s = da / (da - db);
      for (int k = 0; k < 3; ++k) q[k] = a[k] + s * (b[k] - a[k]);
      q[axis] = plane;
    }
  }
  return to;
}

/// The box of what of the triangle lies in the cell, rounded outwards but never beyond the cell or the box before;
/// false: nothing does.
bool clip_to(const VisibleTriangles& triangles, const KdCell& cell, KdRef& ref) {
  Vec3 world[3];
  triangles.place(triangles.triangles[ref.triangle], world);
  Polygon polygon;
  for (const Vec3& p : world) {
    for (int axis = 0; axis < 3; ++axis) polygon.p[polygon.count][axis] = p[axis];
    ++polygon.count;
  }
  for (int axis = 0; axis < 3 && polygon.count > 0; ++axis) {
    polygon = clip(polygon, axis, cell.lo[axis], 1);
    if (polygon.count > 0) polygon = clip(polygon, axis, cell.hi[axis], -1);
  }
  if (polygon.count == 0) return false;
  for (int axis = 0; axis < 3; ++axis) {
    double lo = polygon.p[0][axis], hi = lo;
    for (int i = 1; i < polygon.count; ++i)
      lo = std::min(lo, polygon.p[i][axis]), hi = std::max(hi, polygon.p[i][axis]);
    constexpr float kInf = std::numeric_limits<float>::infinity();
    float lo_out = static_cast<float>(lo), hi_out = static_cast<float>(hi);
    if (lo_out > lo) lo_out = std::nextafter(lo_out, -kInf);
    if (hi_out < hi) hi_out = std::nextafter(hi_out, kInf);
    ref.lo[axis] = std::clamp(lo_out, std::max(ref.lo[axis], cell.lo[axis]), cell.hi[axis]);
    ref.hi[axis] = std::clamp(hi_out, ref.lo[axis], std::min(std::max(ref.hi[axis], ref.lo[axis]), cell.hi[axis]));
  }
  return true;
}

}  // namespace

KdSplit find_split(const KdCell& cell, const std::vector<KdRef>& refs) {
  KdSplit best;
  std::vector<Event> events;
  for (int axis = 0; axis < 3; ++axis) {
    const PlaneCost cost(cell, axis, refs.size());
    if (refs.size() > kSweptRefs) {
      try_bins(cost, cell, axis, refs, best);
    } else {
      sweep(cost, axis, refs, events, best);
    }
  }
  return best;
}

void cut_refs(const VisibleTriangles& triangles, const KdCell& cell, const KdSplit& split,
              std::vector<KdRef>&& refs, std::vector<KdRef>& left, std::vector<KdRef>& right) {
  const std::vector<KdRef> all = std::move(refs);
  const int axis = split.axis;
  KdCell left_cell = cell, right_cell = cell;
  left_cell.hi[axis] = right_cell.lo[axis] = split.plane;
  for (const KdRef& ref : all) {
    const bool in_plane = ref.lo[axis] == split.plane && ref.hi[axis] == split.plane;
    if (in_plane) {
      (split.planar_left ? left : right).push_back(ref);
    } else if (ref.hi[axis] <= split.plane) {
      left.push_back(ref);
    } else if (ref.lo[axis] >= split.plane) {
      right.push_back(ref);
    } else {
      KdRef part = ref;
      if (clip_to(triangles, left_cell, part)) left.push_back(part);
      part = ref;
      if (clip_to(triangles, right_cell, part)) right.push_back(part);
    }
  }
}

}  // namespace shoal::bench
