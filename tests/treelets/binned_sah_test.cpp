#include "treelets/binned_sah.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/support/sample_soups.h"
#include "treelets/partition_refs.h"
#include "treelets/sah_bins.h"
#include "treelets/triangle_refs.h"

namespace shoal {
namespace {

std::vector<BuildRef> random_refs(uint32_t count, float scale = 1) {
  TriangleSoup soup = testing::random_soup(count, 0.05f, count);
  for (float& x : soup.positions) x *= scale;
  const RefArray array = make_refs(soup.positions);
  return {array.refs().begin(), array.refs().end()};
}

struct Plane {
  double cost = 0;
  uint64_t left_count = 0, right_count = 0;
  LaneBox left, right, left_centroids, right_centroids;
};

// What a split costs by its definition, without bins.
Plane measure_plane(std::span<const BuildRef> refs, const Binning& binning, int axis, uint32_t bin, uint32_t block) {
  Plane plane;
  for (const BuildRef& ref : refs) {
    int32_t bins[4];
    binning.bins_of(ref, bins);
    const bool goes_left = static_cast<uint32_t>(bins[axis]) < bin;
    ++(goes_left ? plane.left_count : plane.right_count);
    (goes_left ? plane.left : plane.right).include(LaneBox{lanes_load3(ref.lo), lanes_load3(ref.hi)});
    (goes_left ? plane.left_centroids : plane.right_centroids).include(binning_centroid(ref));
  }
  const auto tests = [block](uint64_t count) { return static_cast<double>((count + block - 1) / block); };
  if (plane.left_count == 0 || plane.right_count == 0) {
    plane.cost = std::numeric_limits<double>::infinity();
  } else {
    plane.cost = half_area(plane.left) * tests(plane.left_count) + half_area(plane.right) * tests(plane.right_count);
  }
  return plane;
}

void expect_equal(const LaneBox& a, const LaneBox& b) {
  const Bounds3 x = a.bounds(), y = b.bounds();
  EXPECT_EQ(x.lo, y.lo);
  EXPECT_EQ(x.hi, y.hi);
}

struct Node {
  explicit Node(std::span<const BuildRef> refs) { measure_refs(refs, box, centroids); }
  LaneBox box, centroids;
};

// Sizes with few bins, with many, and with bins of several tasks; coordinates as far out as they may be, and tiny ones.
constexpr uint32_t kCounts[] = {2, 9, 100, 1000, 70000};
constexpr float kScales[] = {1, 0x1p124f, 0x1p-60f};

TEST(SahBins, FindsTheCheapestPlane) {
  for (const uint32_t count : kCounts) {
    for (const float scale : kScales) {
      for (const uint32_t block : {1u, 8u}) {
        SCOPED_TRACE(count);
        if (count > 1000 && (scale != 1 || block != 8)) continue;
        const std::vector<BuildRef> refs = random_refs(count, scale);
        const Node node(refs);
        const Binning binning(node.centroids, count);
        SahBins bins(binning.bin_count());
        fill_bins(refs, binning, bins);
        const SahSplit split = bins.best_split(node.box, block);
        ASSERT_TRUE(split.found());
        double cheapest = std::numeric_limits<double>::infinity();
        for (int axis = 0; axis < 3; ++axis) {
          for (uint32_t bin = 1; bin < binning.bin_count(); ++bin) {
            cheapest = std::min(cheapest, measure_plane(refs, binning, axis, bin, block).cost);
          }
        }
        const Plane chosen = measure_plane(refs, binning, split.axis, split.bin, block);
        EXPECT_LE(chosen.cost, cheapest * 1.00001);
        EXPECT_NEAR(split.cost / chosen.cost, 1, 1e-5);
        LaneBox left, right;
        bins.child_boxes(split, left, right);
        expect_equal(left, chosen.left);
        expect_equal(right, chosen.right);
      }
    }
  }
}

TEST(SahBins, TakesTheMostEvenOfPlanesThatCostTheSame) {
  std::vector<BuildRef> refs;  // points on a line: no side has an area
  for (uint32_t i = 0; i < 64; ++i) {
    const auto x = static_cast<float>(i);
    refs.push_back({{x, 0, 0}, i, {x, 0, 0}, 0});
  }
  const Node node(refs);
  const Binning binning(node.centroids, 64);
  SahBins bins(binning.bin_count());
  fill_bins(refs, binning, bins);
  const SahSplit split = bins.best_split(node.box, 1);
  EXPECT_EQ(split.axis, 0);
  EXPECT_EQ(split.bin, binning.bin_count() / 2);
}

TEST(PartitionRefs, PutsEverySideInItsPlace) {
  for (const uint32_t count : {2u, 100u, 70000u, 200000u}) {  // the last by several tasks
    SCOPED_TRACE(count);
    std::vector<BuildRef> refs = random_refs(count);
    const Node node(refs);
    const Binning binning(node.centroids, count);
    SahBins bins(binning.bin_count());
    fill_bins(refs, binning, bins);
    const SahSplit split = bins.best_split(node.box, 1);
    const Plane expected = measure_plane(refs, binning, split.axis, split.bin, 1);
    LaneBox left, right;
    const size_t border = partition_refs(refs, binning, split, left, right);
    ASSERT_EQ(border, expected.left_count);
    expect_equal(left, expected.left_centroids);
    expect_equal(right, expected.right_centroids);
    const std::span<const BuildRef> all(refs);
    EXPECT_EQ(measure_plane(all.first(border), binning, split.axis, split.bin, 1).right_count, 0u);
    EXPECT_EQ(measure_plane(all.subspan(border), binning, split.axis, split.bin, 1).left_count, 0u);
    std::vector<bool> found(count);
    for (const BuildRef& ref : refs) found[ref.id] = true;
    EXPECT_EQ(std::count(found.begin(), found.end(), true), count);
  }
}

TEST(BinnedSah, MakesLeavesOfTheSizeThatIsAskedFor) {
  for (const SahModel& model : {SahModel{1}, SahModel{8}, SahModel{16}, SahModel{8, 1}, SahModel{5, 4}}) {
    std::vector<BuildRef> refs = random_refs(20000);
    const std::vector<BinaryNode> tree = build_binary_tree(refs, model);
    uint64_t sum = 0;
    for (const BinaryNode& node : tree) {
      if (!node.leaf()) continue;
      EXPECT_LE(node.count, model.leaf_size);
      sum += node.count;
    }
    EXPECT_EQ(sum, refs.size());
  }
}

TEST(BinnedSah, MakesTheSameTreeWithAnyNumberOfThreads) {
  for (const uint32_t block : {1u, 8u}) {
    std::vector<BuildRef> refs[2] = {random_refs(300000), random_refs(300000)};
    std::vector<BinaryNode> trees[2];
    for (const size_t threads : {1, 2}) {
      const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
      trees[threads - 1] = build_binary_tree(refs[threads - 1], {8, block});
    }
    ASSERT_EQ(trees[0].size(), trees[1].size());
    EXPECT_EQ(std::memcmp(trees[0].data(), trees[1].data(), trees[0].size() * sizeof(BinaryNode)), 0);
    EXPECT_EQ(std::memcmp(refs[0].data(), refs[1].data(), refs[0].size() * sizeof(BuildRef)), 0);
  }
}

}  // namespace
}  // namespace shoal
