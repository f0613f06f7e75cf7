#include "treelets/split_chunks.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/support/sample_soups.h"
#include "tests/support/treelet_reader.h"
#include "treelets/build_forest.h"

namespace shoal {
namespace {

using testing::add_triangle;
using testing::grid_soup;
using testing::MemorySink;
using testing::random_soup;

ChunkGrid count(const TriangleSoup& soup, uint32_t max_cells) {
  Bounds3 centroids;
  for (size_t i = 0; i < soup.size(); ++i) centroids.include(chunk_centroid(&soup.positions[9 * i]));
  ChunkGrid grid(centroids, max_cells);
  for (size_t i = 0; i < soup.size(); ++i) grid.add(grid.cell_of(&soup.positions[9 * i]), &soup.positions[9 * i]);
  return grid;
}

// Every part has its cells, every chunk its parts, and all triangles are there once.
void expect_whole(const ChunkPlan& plan, const ChunkGrid& grid, uint64_t limit) {
  std::vector<uint64_t> of_part(plan.part_triangles.size(), 0);
  for (size_t cell = 0; cell < grid.cells().size(); ++cell) {
    if (grid.cells()[cell].count == 0) {
      EXPECT_EQ(plan.part_of_cell[cell], kNoIndex);
    } else {
      of_part.at(plan.part_of_cell[cell]) += grid.cells()[cell].count;
    }
  }
  uint64_t total = 0;
  uint32_t next = 0;
  for (size_t c = 0; c < plan.chunks.size(); ++c) {
    const Chunk& chunk = plan.chunks[c];
    EXPECT_EQ(chunk.first_part, next);
    uint64_t triangles = 0;
    for (next = chunk.first_part; next < chunk.last_part; ++next) {
      EXPECT_EQ(of_part[next], plan.part_triangles[next]);
      EXPECT_EQ(plan.chunk_of_part[next], c);
      triangles += plan.part_triangles[next];
    }
    EXPECT_EQ(triangles, chunk.triangles_count);
    EXPECT_EQ(chunk.too_large, triangles > limit);
    if (chunk.too_large) {
      EXPECT_EQ(chunk.last_part - chunk.first_part, 1u);
    }
    if (c > 0) {
      EXPECT_GT(plan.chunks[c - 1].triangles_count + triangles, limit);
    }
    total += triangles;
  }
  EXPECT_EQ(next, plan.part_triangles.size());
  EXPECT_EQ(total, grid.triangles_count());
  EXPECT_LE(plan.chunks.size(), 2 * total / limit + 1);
}

uint32_t depth_of(const ChunkPlan& plan, uint32_t node) {
  if (plan.tree[node].left == kNoIndex) return 1;
  return 1 + std::max(depth_of(plan, plan.tree[node].left), depth_of(plan, plan.tree[node].left + 1));
}

TEST(SplitChunks, CutsAMeshIntoPartsThatFit) {
  const TriangleSoup soup = grid_soup(100);
  for (const uint64_t limit : {500u, 3000u, 19999u, 20000u}) {
    const ChunkGrid grid = count(soup, 4096);
    const ChunkPlan plan = split_chunks(grid, limit);
    expect_whole(plan, grid, limit);
    EXPECT_EQ(plan.chunks.size() == 1, limit == 20000u);
    for (const Chunk& chunk : plan.chunks) EXPECT_FALSE(chunk.too_large);
  }
}

TEST(SplitChunks, MarksACellThatHoldsTooMuch) {
  TriangleSoup soup = random_soup(2000, 1e-4f);
  for (float& p : soup.positions) p *= 1e-3f;  // a teapot
  add_triangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  add_triangle(soup, {100, 100, 100}, {101, 100, 100}, {100, 101, 100});  // in a stadium
  const ChunkGrid grid = count(soup, 4096);
  const ChunkPlan plan = split_chunks(grid, 500);
  expect_whole(plan, grid, 500);
  uint64_t in_large = 0;
  for (const Chunk& chunk : plan.chunks) in_large += chunk.too_large ? chunk.triangles_count : 0;
  EXPECT_GE(in_large, 2000u);
}

TEST(SplitChunks, StaysShallowWhereverTheTrianglesLie) {
  TriangleSoup soup;
  for (int i = 0; i < 3000; ++i) {  // ever closer to the origin
    const float x = std::ldexp(1.0f, -(i % 100)) * (1 + 0.0001f * static_cast<float>(i));
    add_triangle(soup, {x, 0, 0}, {x, x, 0}, {x, 0, x});
  }
  const ChunkGrid grid = count(soup, 1u << 16);
  const ChunkPlan plan = split_chunks(grid, 10);
  expect_whole(plan, grid, 10);
  EXPECT_LE(depth_of(plan, 0), 72u);
}

TEST(SplitChunks, NothingGivesNoChunks) {
  const ChunkPlan plan = split_chunks(count(TriangleSoup(), 4096), 10);
  EXPECT_TRUE(plan.tree.empty());
  EXPECT_TRUE(plan.chunks.empty());
}

TEST(ChunkGrid, CannotDivideTrianglesInOnePlace) {
  TriangleSoup soup;
  for (int i = 0; i < 20; ++i) add_triangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  EXPECT_FALSE(count(soup, 4096).divides());
  add_triangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 1.0001f, 0});
  const ChunkGrid grid = count(soup, 4096);
  EXPECT_TRUE(grid.divides());
  EXPECT_NE(grid.cell_of(&soup.positions[0]), grid.cell_of(&soup.positions[9 * 20]));
}

TEST(ChunkGrid, HoldsCoordinatesUpToTheLargest) {
  constexpr float m = kMaxCoordinate;
  TriangleSoup soup;
  add_triangle(soup, {-m, -m, -m}, {-m, -m, 0}, {-m, 0, -m});
  add_triangle(soup, {m, m, m}, {m, m, 0}, {m, 0, m});
  add_triangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const ChunkGrid grid = count(soup, 4096);
  EXPECT_EQ(grid.triangles_count(), 3u);
  EXPECT_NE(grid.cell_of(&soup.positions[0]), grid.cell_of(&soup.positions[9]));
  expect_whole(split_chunks(grid, 1), grid, 1);
}

// Built in parts by the cells of a grid, then grafted: every triangle is there, and the tree costs what one built at
// once costs.
TEST(GraftTrees, AnObjectInPartsCostsAboutWhatItCostsAtOnce) {
  for (TriangleSoup soup : {grid_soup(150), random_soup(30000, 0.01f)}) {
    const ChunkGrid grid = count(soup, 1u << 14);
    const ChunkPlan plan = split_chunks(grid, 2500);
    ASSERT_GT(plan.part_triangles.size(), 8u);
    std::vector<uint32_t> part_of;
    for (size_t i = 0; i < soup.size(); ++i) part_of.push_back(plan.part_of_cell[grid.cell_of(&soup.positions[9 * i])]);
    const size_t triangles = soup.size();

    MemorySink sink, sink_at_once;
    UpperForest forest;
    std::vector<TreeletEntry> entries;
    ForestSums sums;
    const auto parts = static_cast<uint32_t>(plan.part_triangles.size());
    const Status status = build_forest(TriangleSoup(soup), std::move(part_of), parts, {16u << 10}, nullptr, sink, forest,
                                       entries, sums);
    ASSERT_TRUE(status.ok()) << status.error().message;
    ASSERT_EQ(forest.roots.size(), parts);
    const BuiltObject object = finish_object(graft_trees(plan.tree, forest), std::move(entries), sums);
    uint64_t found = 0;
    read_object(object, sink.treelets, [&](const testing::ReadTriangle&) { ++found; });
    EXPECT_EQ(found, triangles);

    const auto at_once = build_object(std::move(soup), {16u << 10}, nullptr, sink_at_once);
    ASSERT_TRUE(at_once.ok());
    EXPECT_LE(object.sah_cost, 1.05 * at_once.value().sah_cost);
    EXPECT_LE(sink.treelets.size(), sink_at_once.treelets.size() * 1.15);
    EXPECT_EQ(object.triangles_count, at_once.value().triangles_count);
  }
}

}  // namespace
}  // namespace shoal
