#include "engine/build_light_tree.h"

#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <span>

#include "engine/math.h"
#include "engine/split_lights.h"
#include "treelets/ray.h"

namespace shoal {
namespace {

constexpr size_t kParallelCount = 512;  ///< chosen: fewer clusters are no task of their own
/// Chosen: below this depth sets are halved, so that no tree is much deeper.
constexpr int kMaxCostDepth = 48;

LightBounds bounds_of(const TreeLight& light) {
  LightBounds b;
  b.box = {{light.lo[0], light.lo[1], light.lo[2]}, {light.hi[0], light.hi[1], light.hi[2]}};
  b.cone.axis = {light.axis[0], light.axis[1], light.axis[2]};
  b.cone.angle = light.angle;
  if (light.angle > 0) b.cone.cos_angle = light.angle < kPi ? sin_cos(light.angle).cos : -1.0f;
  b.cone.both_sides = light.both_sides != 0;
  b.emission_angle = light.emission_angle;
  b.strength = light.strength;
  b.range = light.range;
  return b;
}

/// Lays out the tree over lights, whose first leaf is given; what a node's child is.
class Builder {
 public:
  /// `ranges`: empty, or as many as forks.
  Builder(uint32_t cluster_size, size_t task_count, std::span<LightFork> forks, std::span<LightRanges> ranges,
          std::span<uint32_t> leaf_of)
      : cluster_size_(cluster_size), task_count_(task_count), forks_(forks), ranges_(ranges), leaf_of_(leaf_of) {}

  uint32_t lay_out(std::span<TreeLight> lights, uint32_t first_leaf, int depth, LightBounds& bounds) {
    if (depth >= kMaxCostDepth) return lay_out_run(lights, first_leaf, depth, bounds);
    std::vector<LightCluster> clusters = cluster_lights(lights, cluster_size_);
    if (clusters.size() == 1) return lay_out_run(lights, first_leaf, kMaxCostDepth, bounds);  // all in one place
    return lay_out_clusters(clusters, lights, first_leaf, depth, bounds);
  }

 private:
  /// Lights in their order: a cluster of a few, or below kMaxCostDepth any number.
  uint32_t lay_out_run(std::span<TreeLight> lights, uint32_t first_leaf, int depth, LightBounds& bounds) {
    if (lights.size() == 1) {
      bounds = bounds_of(lights[0]);
      leaf_of_[lights[0].light] = first_leaf;
      return LightNode::kLeafBit | lights[0].light;
    }
    const size_t left = depth < kMaxCostDepth ? split_run(lights) : lights.size() / 2;
    const uint32_t middle = first_leaf + static_cast<uint32_t>(left);
    LightBounds sides[2];
    const uint32_t children[2] = {lay_out_run(lights.first(left), first_leaf, depth + 1, sides[0]),
                                  lay_out_run(lights.subspan(left), middle, depth + 1, sides[1])};
    return join(middle, sides, children, bounds);
  }

  /// `lights`: all that the clusters are cut from.
  uint32_t lay_out_clusters(std::span<LightCluster> clusters, std::span<TreeLight> lights, uint32_t first_leaf,
                            int depth, LightBounds& bounds) {
    if (clusters.size() == 1) {
      const std::span<TreeLight> inside = lights.subspan(clusters[0].first, clusters[0].count);
      for (const TreeLight& light : inside) __builtin_prefetch(&leaf_of_[light.light], 1);
      return clusters[0].count <= cluster_size_ ? lay_out_run(inside, first_leaf, depth, bounds)
                                                : lay_out(inside, first_leaf, depth, bounds);
    }
    const size_t split = depth < kMaxCostDepth ? split_clusters(clusters) : clusters.size() / 2;
    const std::span<LightCluster> parts[2] = {clusters.first(split), clusters.subspan(split)};
    uint32_t middle = first_leaf;
    for (const LightCluster& cluster : parts[0]) middle += cluster.count;
    LightBounds sides[2];
    uint32_t children[2];
    const auto left = [&] { children[0] = lay_out_clusters(parts[0], lights, first_leaf, depth + 1, sides[0]); };
    const auto right = [&] { children[1] = lay_out_clusters(parts[1], lights, middle, depth + 1, sides[1]); };
    if (clusters.size() >= task_count_) {
      tbb::parallel_invoke(left, right);
    } else {
      left(), right();
    }
    return join(middle, sides, children, bounds);
  }

  uint32_t join(uint32_t middle, const LightBounds (&sides)[2], const uint32_t (&children)[2], LightBounds& bounds) {
    for (int i = 0; i < 2; ++i) forks_[middle - 1].side[i] = pack_light_node(sides[i], children[i]);
    if (!ranges_.empty()) ranges_[middle - 1] = {{sides[0].range, sides[1].range}};
    bounds = sides[0];
    bounds.add(sides[1]);
    return middle - 1;
  }

  uint32_t cluster_size_;
  size_t task_count_;  ///< so many clusters are shared among threads
  std::span<LightFork> forks_;
  std::span<LightRanges> ranges_;
  std::span<uint32_t> leaf_of_;
};

}  // namespace

LightTree build_light_tree(std::vector<TreeLight> lights, uint32_t light_count, unsigned threads) {
  if (lights.empty()) return {};
  std::vector<LightFork> forks(lights.size() - 1);
  std::vector<uint32_t> leaf_of(light_count, kNoIndex);
  const bool any_range = std::any_of(lights.begin(), lights.end(), [](const TreeLight& light) {
    return light.range < std::numeric_limits<float>::infinity();
  });
  std::vector<LightRanges> ranges(any_range ? forks.size() : 0);
  uint32_t root = 0;
  const auto lay_out = [&](size_t task_count) {
    LightBounds bounds;
    root = Builder(cluster_size(lights.size()), task_count, forks, ranges, leaf_of).lay_out(lights, 0, 0, bounds);
  };
  const int workers = std::min(static_cast<int>(threads), tbb::this_task_arena::max_concurrency());
  if (workers > 1 && lights.size() >= kParallelCount) {
    tbb::task_arena(workers).execute([&] { lay_out(kParallelCount); });
  } else {
    lay_out(SIZE_MAX);
  }
  return LightTree(root, std::move(forks), std::move(leaf_of), std::move(ranges));
}

uint64_t light_tree_bytes(uint64_t lights, uint64_t light_count, bool ranges) {
  return lights * (sizeof(LightFork) + (ranges ? sizeof(LightRanges) : 0)) + light_count * sizeof(uint32_t);
}

uint64_t light_building_bytes(uint64_t lights) { return lights * sizeof(TreeLight) + clustering_bytes(lights); }

}  // namespace shoal
