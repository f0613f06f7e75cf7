#include "engine/build_light_tree.h"

#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <span>

#include "engine/math.h"
#include "io/result.h"
#include "treelets/ray.h"

namespace shoal {
namespace {

constexpr int kBuckets = 12;            // as in PBRT 4e
constexpr size_t kMedianCount = 4;      ///< chosen: so few lights are parted in the middle of their longest axis
constexpr size_t kParallelCount = 4096;  ///< chosen: fewer are no task of their own
/// Chosen: below this depth lights are parted in the middle, so that no tree is deeper than this and 31 more.
constexpr int kMaxCostDepth = 48;
/// An axis along which the lights spread less than this share of the longest is not tried: chosen.
constexpr double kLeastSpread = 1.0 / 16;

LightBounds bounds_of(const TreeLight& light) {
  LightBounds b;
  b.box = {{light.lo[0], light.lo[1], light.lo[2]}, {light.hi[0], light.hi[1], light.hi[2]}};
  b.cone.axis = {light.axis[0], light.axis[1], light.axis[2]};
  b.cone.angle = light.angle;
  if (light.angle > 0) b.cone.cos_angle = light.angle < kPi ? sin_cos(light.angle).cos : -1.0f;
  b.cone.both_sides = light.both_sides != 0;
  b.emission_angle = light.emission_angle;
  b.strength = light.strength;
  return b;
}

/// Twice the middle of the box.
double middle(const TreeLight& light, int axis) { return double{light.lo[axis]} + light.hi[axis]; }

struct Spread {
  double lo[3], hi[3];

  double extent(int axis) const { return hi[axis] - lo[axis]; }
  int longest() const {
    int axis = 0;
    for (int a = 1; a < 3; ++a) {
      if (extent(a) > extent(axis)) axis = a;
    }
    return axis;
  }
  int bucket(const TreeLight& light, int axis) const {
    const double at = (middle(light, axis) - lo[axis]) / extent(axis);
    return std::clamp(static_cast<int>(at * kBuckets), 0, kBuckets - 1);
  }
};

Spread spread_of(std::span<const TreeLight> lights) {
  Spread s;
  for (int a = 0; a < 3; ++a) {
    s.lo[a] = s.hi[a] = middle(lights[0], a);
    for (const TreeLight& light : lights) {
      s.lo[a] = std::min(s.lo[a], middle(light, a));
      s.hi[a] = std::max(s.hi[a], middle(light, a));
    }
  }
  return s;
}

struct Split {
  int axis = -1;
  int last_bucket = 0;  ///< of the left side
  double cost = 0;
};

/// The cheapest split along an axis that leaves neither side empty, if it is cheaper than `best`.
void try_axis(std::span<const TreeLight> lights, const Spread& spread, int axis, Split& best) {
  LightBounds buckets[kBuckets];
  for (const TreeLight& light : lights) buckets[spread.bucket(light, axis)].add(bounds_of(light));
  double right_cost[kBuckets] = {};
  bool right_has_some[kBuckets] = {};
  LightBounds right;
  for (int i = kBuckets - 1; i > 0; --i) {
    right.add(buckets[i]);
    right_has_some[i] = right.strength > 0;
    right_cost[i] = light_split_cost(right);
  }
  LightBounds left;
  for (int i = 0; i + 1 < kBuckets; ++i) {
    left.add(buckets[i]);
    if (!(left.strength > 0) || !right_has_some[i + 1]) continue;
    const double cost = light_split_cost(left) + right_cost[i + 1];
    if (best.axis < 0 || cost < best.cost) best = {axis, i, cost};
  }
}

/// Parts lights in place; how many are left. Both sides have some.
size_t part_by(const Spread& spread, const Split& split, std::span<TreeLight> lights) {
  size_t left = 0, right = lights.size();
  while (left < right) {
    if (spread.bucket(lights[left], split.axis) <= split.last_bucket) {
      ++left;
    } else {
      std::swap(lights[left], lights[--right]);
    }
  }
  return left;
}

size_t part(std::span<TreeLight> lights, int depth) {
  if (lights.size() == 2) return 1;
  const Spread spread = spread_of(lights);
  const int longest = spread.longest();
  const size_t half = lights.size() / 2;
  if (!(spread.extent(longest) > 0)) return half;
  if (lights.size() <= kMedianCount || depth >= kMaxCostDepth) {
    std::sort(lights.begin(), lights.end(), [longest](const TreeLight& a, const TreeLight& b) {
      const double ma = middle(a, longest), mb = middle(b, longest);
      return ma != mb ? ma < mb : a.light < b.light;
    });
    return half;
  }
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (spread.extent(axis) >= kLeastSpread * spread.extent(longest)) try_axis(lights, spread, axis, best);
  }
  SHOAL_CHECK(best.axis >= 0);  // the ends of the longest axis are in different buckets: positions are finite
  return part_by(spread, best, lights);
}

class Builder {
 public:
  Builder(std::span<TreeLight> lights, size_t task_count, std::vector<LightFork>& forks,
          std::vector<uint32_t>& leaf_of)
      : lights_(lights), task_count_(task_count), forks_(forks), leaf_of_(leaf_of) {}

  /// Lays out the tree over lights [begin, end); returns what its node's child is.
  uint32_t lay_out(size_t begin, size_t end, int depth, LightBounds& bounds) {
    if (end - begin == 1) {
      const TreeLight& light = lights_[begin];
      bounds = bounds_of(light);
      leaf_of_[light.light] = static_cast<uint32_t>(begin);
      return LightNode::kLeafBit | light.light;
    }
    const size_t middle = begin + part(lights_.subspan(begin, end - begin), depth);
    const uint32_t fork = static_cast<uint32_t>(middle - 1);
    LightBounds sides[2];
    uint32_t children[2];
    const auto left = [&] { children[0] = lay_out(begin, middle, depth + 1, sides[0]); };
    const auto right = [&] { children[1] = lay_out(middle, end, depth + 1, sides[1]); };
    if (end - begin >= task_count_) {
      tbb::parallel_invoke(left, right);
    } else {
      left(), right();
    }
    for (int i = 0; i < 2; ++i) forks_[fork].side[i] = pack_light_node(sides[i], children[i]);
    bounds = sides[0];
    bounds.add(sides[1]);
    return fork;
  }

 private:
  std::span<TreeLight> lights_;
  size_t task_count_;  ///< so many lights are shared among threads
  std::vector<LightFork>& forks_;
  std::vector<uint32_t>& leaf_of_;
};

}  // namespace

LightTree build_light_tree(std::vector<TreeLight> lights, uint32_t light_count, unsigned threads) {
  if (lights.empty()) return {};
  std::vector<LightFork> forks(lights.size() - 1);
  std::vector<uint32_t> leaf_of(light_count, kNoIndex);
  uint32_t root = 0;
  const auto lay_out = [&](size_t task_count) {
    LightBounds bounds;
    root = Builder(lights, task_count, forks, leaf_of).lay_out(0, lights.size(), 0, bounds);
  };
  const int workers = std::min(static_cast<int>(threads), tbb::this_task_arena::max_concurrency());
  if (workers > 1 && lights.size() >= kParallelCount) {
    tbb::task_arena(workers).execute([&] { lay_out(kParallelCount); });
  } else {
    lay_out(SIZE_MAX);
  }
  return LightTree(root, std::move(forks), std::move(leaf_of));
}

uint64_t light_tree_bytes(uint64_t lights, uint64_t light_count) {
  return lights * sizeof(LightFork) + light_count * sizeof(uint32_t);
}

}  // namespace shoal
