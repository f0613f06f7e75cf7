#include "engine/split_lights.h"

#include <algorithm>
#include <bit>

#include "io/result.h"

namespace shoal {
namespace {

constexpr int kBuckets = 12;  // as in PBRT 4e
/// An axis along which the clusters spread less than this share of the longest is not tried: chosen.
constexpr double kLeastSpread = 1.0 / 16;

/// Twice the middle of the box.
double middle(const LightCluster& cluster, int axis) {
  return double{cluster.sums.lo[axis]} + cluster.sums.hi[axis];
}

struct Spread {
  double lo[3], hi[3], scale[3];

  double extent(int axis) const { return hi[axis] - lo[axis]; }
  int longest() const {
    int axis = 0;
    for (int a = 1; a < 3; ++a) {
      if (extent(a) > extent(axis)) axis = a;
    }
    return axis;
  }
  int bucket(const LightCluster& cluster, int axis) const {
    return static_cast<int>(std::clamp((middle(cluster, axis) - lo[axis]) * scale[axis], 0.0, kBuckets - 1.0));
  }
};

Spread spread_of(std::span<const LightCluster> clusters) {
  Spread s;
  for (int a = 0; a < 3; ++a) s.lo[a] = s.hi[a] = middle(clusters[0], a);
  for (const LightCluster& cluster : clusters) {
    for (int a = 0; a < 3; ++a) {
      const double at = middle(cluster, a);
      s.lo[a] = at < s.lo[a] ? at : s.lo[a], s.hi[a] = at > s.hi[a] ? at : s.hi[a];
    }
  }
  for (int a = 0; a < 3; ++a) s.scale[a] = kBuckets / s.extent(a);
  return s;
}

struct Split {
  int axis = -1;
  int last_bucket = 0;  ///< of the left side
  double cost = 0;
};

struct Buckets {
  uint32_t used = 0;  ///< a bit each
  LightSums sums[kBuckets];

  void add(int bucket, const LightSums& s) {
    if ((used >> bucket & 1) != 0) {
      sums[bucket].add(s);
    } else {
      used |= 1u << bucket, sums[bucket] = s;
    }
  }
};

/// The cheapest split along an axis, if it is cheaper than `best`. Neither side is empty.
void try_axis(const Buckets& buckets, int axis, Split& best) {
  uint32_t left_of = buckets.used;
  double right_cost[kBuckets];
  int last = std::bit_width(left_of) - 1;
  LightSums right = buckets.sums[last];
  for (left_of &= ~(1u << last); left_of != 0; left_of &= ~(1u << last)) {
    right_cost[last] = light_cost(right);
    last = std::bit_width(left_of) - 1;
    right.add(buckets.sums[last]);
  }
  uint32_t right_of = buckets.used & (buckets.used - 1);
  LightSums left = buckets.sums[std::countr_zero(buckets.used)];
  for (; right_of != 0; right_of &= right_of - 1) {
    const int next = std::countr_zero(right_of);
    if (best.axis < 0 || right_cost[next] < best.cost) {
      const double cost = light_cost(left) + right_cost[next];
      if (best.axis < 0 || cost < best.cost) best = {axis, next - 1, cost};
    }
    left.add(buckets.sums[next]);
  }
}

Split cheapest_split(std::span<const LightCluster> clusters, const Spread& spread) {
  const double least = kLeastSpread * spread.extent(spread.longest());
  int axes[3], axis_count = 0;
  for (int a = 0; a < 3; ++a) {
    if (spread.extent(a) >= least) axes[axis_count++] = a;
  }
  Buckets buckets[3];
  for (const LightCluster& cluster : clusters) {
    for (int k = 0; k < axis_count; ++k) buckets[k].add(spread.bucket(cluster, axes[k]), cluster.sums);
  }
  Split best;
  for (int k = 0; k < axis_count; ++k) try_axis(buckets[k], axes[k], best);
  SHOAL_CHECK(best.axis >= 0);  // the ends of the longest axis are in different buckets: positions are finite
  return best;
}

size_t part_by(const Spread& spread, const Split& split, std::span<LightCluster> clusters) {
  size_t left = 0, right = clusters.size();
  while (left < right) {
    if (spread.bucket(clusters[left], split.axis) <= split.last_bucket) {
      ++left;
    } else {
      std::swap(clusters[left], clusters[--right]);
    }
  }
  return left;
}

}  // namespace

size_t split_clusters(std::span<LightCluster> clusters) {
  if (clusters.size() == 2) return 1;
  const Spread spread = spread_of(clusters);
  if (!(spread.extent(spread.longest()) > 0)) return clusters.size() / 2;
  return part_by(spread, cheapest_split(clusters, spread), clusters);
}

size_t split_run(std::span<const TreeLight> lights) {
  const size_t count = lights.size();
  if (count == 2) return 1;
  LightSums sums[kLargestCluster];
  for (size_t i = 0; i < count; ++i) sums[i] = LightSums(lights[i]);
  double right_cost[kLargestCluster];
  LightSums right = sums[count - 1];
  for (size_t i = count - 1; i > 0; --i) {
    right_cost[i] = light_cost(right);
    if (i > 1) right.add(sums[i - 1]);
  }
  size_t best = 1;
  double best_cost = 0;
  LightSums left = sums[0];
  for (size_t i = 1; i < count; ++i) {
    if (i == 1 || right_cost[i] < best_cost) {
      const double cost = light_cost(left) + right_cost[i];
      if (i == 1 || cost < best_cost) best = i, best_cost = cost;
    }
    left.add(sums[i]);
  }
  return best;
}

}  // namespace shoal
