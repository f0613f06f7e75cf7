#include "treelets/build_object.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <map>

#include "tests/support/sample_soups.h"
#include "tests/support/treelet_reader.h"
#include "treelets/trace_treelet.h"

namespace shoal {
namespace {

using testing::add_attributes;
using testing::add_triangle;
using testing::FullCorner;
using testing::MemorySink;
using testing::ReadCounts;
using testing::ReadTriangle;

struct Built {
  BuiltObject object;
  MemorySink sink;
};

Built build(TriangleSoup soup, uint32_t treelet_bytes) {
  Built built;
  Result<BuiltObject> object = build_object(std::move(soup), {treelet_bytes}, nullptr, built.sink);
  EXPECT_TRUE(object.ok()) << object.error().message;
  if (object.ok()) built.object = std::move(object).value();
  return built;
}

// The corner as it should come back: what the layout has not has its default.
FullCorner expected_corner(const TriangleSoup& soup, size_t corner) {
  const CornerLayout& l = soup.layout;
  FullCorner full{};
  for (int i = 7; i < 11; ++i) full[i] = 1;
  if (l.floats() == 0) return full;
  const float* from = &soup.corners[corner * l.floats()];
  if (l.normal) std::copy_n(from + l.normal_offset(), 3, full.begin());
  if (l.tangent) std::copy_n(from + l.tangent_offset(), 4, full.begin() + 3);
  if (l.color) std::copy_n(from + l.color_offset(), 4, full.begin() + 7);
  std::copy_n(from + l.uv_offset(0), 2 * l.uv_count, full.begin() + 11);
  return full;
}

// What the builder writes, the checks of a renderer accept.
void expect_pages_pass(const Built& built) {
  for (const testing::StoredTreelet& treelet : built.sink.treelets) {
    const Status geometry = check_treelet(treelet.geometry);
    EXPECT_TRUE(geometry.ok()) << geometry.error().message;
    if (treelet.attributes.empty()) continue;
    const Status attributes = check_attributes(treelet.attributes);
    EXPECT_TRUE(attributes.ok()) << attributes.error().message;
  }
}

// Every triangle of the soup but `skipped` ids is found once, bit by bit; the reader checks boxes and links.
ReadCounts expect_holds(const Built& built, const TriangleSoup& soup, uint64_t skipped_count = 0) {
  std::map<uint32_t, size_t> place;
  for (size_t i = 0; i < soup.size(); ++i) place[soup.primitive[i]] = i;
  expect_pages_pass(built);
  uint64_t found = 0;
  const ReadCounts counts = read_object(built.object, built.sink.treelets, [&](const ReadTriangle& t) {
    const auto it = place.find(t.primitive);
    ASSERT_NE(it, place.end()) << "primitive " << t.primitive << " is unknown or came twice";
    const size_t i = it->second;
    place.erase(it);
    ++found;
    EXPECT_EQ(std::memcmp(t.position, &soup.positions[9 * i], sizeof t.position), 0) << "triangle " << i;
    EXPECT_EQ(t.material, soup.material[i]);
    for (size_t c = 0; c < 3; ++c) {
      const FullCorner expected = expected_corner(soup, 3 * i + c);
      EXPECT_EQ(std::memcmp(expected.data(), t.corner[c].data(), sizeof expected), 0) << "corner of triangle " << i;
    }
  });
  EXPECT_EQ(found + skipped_count, soup.size());
  EXPECT_EQ(built.object.triangles_count, found);
  EXPECT_EQ(built.object.degenerate_count, skipped_count);
  EXPECT_EQ(built.object.leaves_count, counts.leaves);
  return counts;
}

constexpr uint32_t kSizes[] = {4u << 10, 64u << 10, 4u << 20};

TEST(BuildObject, StoresEveryTriangleOfARandomSoupOnce) {
  for (const uint32_t size : kSizes) {
    for (const uint32_t count : {1u, 2u, 8u, 9u, 1000u, 20000u}) {
      const TriangleSoup soup = testing::random_soup(count, 0.02f);
      expect_holds(build(soup, size), soup);
    }
  }
}

TEST(BuildObject, StoresEveryTriangleOfAGridOnce) {
  for (const uint32_t size : kSizes) {
    const TriangleSoup soup = testing::grid_soup(100);
    expect_holds(build(soup, size), soup);
  }
}

size_t geometry_bytes(const Built& built) {
  size_t bytes = 0;
  for (const testing::StoredTreelet& treelet : built.sink.treelets) bytes += treelet.geometry.size();
  return bytes;
}

TEST(BuildObject, StoresTheVeryPositionsOfAGridInFewerBytes) {
  for (const float step : {0x1p-20f, 0x1p-16f, 0x1p-11f, 0x1p-9f}) {
    TriangleSoup soup = testing::grid_soup(120);
    for (float& x : soup.positions) x = std::nearbyint(x / step) * step - 0.5f;
    const size_t plain = geometry_bytes(build(soup, 64u << 10));
    soup.position_step = step;
    const Built built = build(soup, 64u << 10);
    const ReadCounts counts = expect_holds(built, soup);
    EXPECT_GT(static_cast<double>(counts.grid_leaves), 0.9 * static_cast<double>(counts.leaves)) << step;
    EXPECT_LT(static_cast<double>(geometry_bytes(built)), (step < 0x1p-12f ? 0.95 : 0.8) * static_cast<double>(plain))
        << step;
  }
}

TEST(BuildObject, StoresWhatIsNotOnTheGridAsItIs) {
  TriangleSoup soup = testing::random_soup(1000, 0.02f);
  for (size_t i = 0; i < soup.positions.size() / 2; ++i) {
    soup.positions[i] = std::nearbyint(soup.positions[i] * 4096) / 4096 + 0.0f;
  }
  soup.position_step = 0x1p-12f;
  const ReadCounts counts = expect_holds(build(soup, 16u << 10), soup, 0);
  EXPECT_GT(counts.grid_leaves, 0u);
  EXPECT_LT(counts.grid_leaves, counts.leaves);
  for (const float step : {0x1p-126f, 1.0f, 0x1p104f}) {
    for (testing::NamedSoup& hostile : testing::hostile_soups(200)) {
      SCOPED_TRACE(hostile.name);
      hostile.soup.position_step = step;
      expect_holds(build(hostile.soup, 16u << 10), hostile.soup);
    }
  }
}

TEST(BuildObject, StoresEveryAttributeOfEveryCorner) {
  for (const CornerLayout& layout : {CornerLayout{true, false, false, 0}, CornerLayout{true, true, true, 4},
                                     CornerLayout{false, false, true, 1}, CornerLayout{false, false, false, 2}}) {
    TriangleSoup soup = testing::random_soup(3000, 0.05f);
    add_attributes(soup, layout);
    for (const uint32_t size : kSizes) expect_holds(build(soup, size), soup);
  }
}

TEST(BuildObject, LeavesOutAttributesThatAreAllDefault) {
  TriangleSoup soup = testing::grid_soup(4);
  soup.layout = {true, true, true, 2};
  for (size_t i = 0; i < 3 * soup.size(); ++i) {
    for (uint32_t k = 0; k < soup.layout.floats(); ++k) soup.corners.push_back(k >= 7 && k < 11 ? 1.0f : 0.0f);
  }
  const Built built = build(soup, 64u << 10);
  expect_holds(built, soup);
  ASSERT_EQ(built.sink.treelets.size(), 1u);
  EXPECT_TRUE(built.sink.treelets[0].attributes.empty());

  soup.corners[13] = 0.25f;  // one uv: the first set only
  const Built with_uv = build(soup, 64u << 10);
  expect_holds(with_uv, soup);
  EXPECT_LT(with_uv.sink.treelets[0].attributes.size(), 64 + 6 * soup.size() + 4 + 2 * 8 * 3 + 1);
}

TEST(BuildObject, SurvivesHostileGeometry) {
  for (const testing::NamedSoup& named : testing::hostile_soups(5000)) {
    SCOPED_TRACE(named.name);
    for (const uint32_t size : kSizes) expect_holds(build(named.soup, size), named.soup);
  }
}

TEST(BuildObject, CountsAndSkipsDegenerateTriangles) {
  TriangleSoup soup = testing::grid_soup(10);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  add_triangle(soup, {0, 0, 0}, {-0.0f, 0, -0.0f}, {1, 1, 1});
  add_triangle(soup, {1, 2, 3}, {4, 5, 6}, {1, 2, 3});
  add_triangle(soup, {1, 2, nan}, {4, 5, 6}, {7, 8, 8});
  add_triangle(soup, {1, 2, 0}, {4, inf, 6}, {7, 8, 8});
  add_triangle(soup, {1, 2, 0}, {4, -std::numeric_limits<float>::max(), 6}, {7, 8, 8});
  const Built built = build(soup, 4u << 10);
  expect_holds(built, soup, 5);
}

TEST(BuildObject, GivesAttributesThatAreNotFiniteTheirDefaults) {
  TriangleSoup soup = testing::random_soup(200, 0.1f);
  add_attributes(soup, {true, true, true, 2});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  testing::Numbers numbers(3);
  TriangleSoup expected = soup;
  const uint32_t floats = soup.layout.floats(), starts[] = {0, 3, 7, 11, 13}, sizes[] = {3, 4, 4, 2, 2};
  for (size_t corner = 0; corner < 3 * soup.size(); ++corner) {
    const uint32_t attribute = numbers.below(5);
    const size_t begin = corner * floats + starts[attribute];
    soup.corners[begin + numbers.below(sizes[attribute])] = nan;
    std::fill_n(&expected.corners[begin], sizes[attribute], attribute == 2 ? 1.0f : 0.0f);
  }
  expect_holds(build(soup, 4u << 10), expected);
}

TEST(BuildObject, GivesNoNodesWhenEverythingIsDegenerate) {
  TriangleSoup soup;
  add_triangle(soup, {1, 1, 1}, {1, 1, 1}, {2, 2, 2});
  const Built built = build(soup, 4u << 10);
  EXPECT_TRUE(built.object.nodes.empty());
  EXPECT_TRUE(built.sink.treelets.empty());
  EXPECT_EQ(built.object.degenerate_count, 1u);
  EXPECT_TRUE(build({}, 4u << 10).object.nodes.empty());
}

TEST(BuildObject, GivesTheSameBytesForAnyNumberOfThreads) {
  TriangleSoup soup = testing::random_soup(200000, 0.01f);  // enough for parallel bins and partitions
  add_attributes(soup, {true, false, false, 1});
  Built results[2];
  for (const size_t threads : {1, 2}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    results[threads - 1] = build(soup, 64u << 10);
  }
  const BuiltObject &a = results[0].object, &b = results[1].object;
  EXPECT_EQ(results[0].sink.treelets, results[1].sink.treelets);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  EXPECT_EQ(std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof(TopNode)), 0);
  ASSERT_EQ(a.entries.size(), b.entries.size());
  EXPECT_EQ(std::memcmp(a.entries.data(), b.entries.data(), a.entries.size() * sizeof(TreeletEntry)), 0);
  EXPECT_EQ(a.sah_cost, b.sah_cost);
}

TEST(BuildObject, FillsTreeletsOfABigObject) {
  const TriangleSoup soup = testing::grid_soup(400);
  const Built built = build(soup, 256u << 10);
  const ReadCounts counts = expect_holds(built, soup);
  double bytes = 0;
  for (const auto& treelet : built.sink.treelets) {
    bytes += static_cast<double>(treelet.geometry.size());
    EXPECT_LE(treelet.geometry.size(), 256u << 10);
  }
  const double fill = bytes / static_cast<double>(built.sink.treelets.size() * (256u << 10));
  const double triangle_bytes = bytes / static_cast<double>(soup.size());
  RecordProperty("fill", std::to_string(fill));
  RecordProperty("bytes_a_triangle", std::to_string(triangle_bytes));
  EXPECT_GE(fill, 0.6);
  EXPECT_LE(triangle_bytes, 30.0);
  EXPECT_GE(static_cast<double>(counts.wide_children) / static_cast<double>(counts.wide_nodes), 3.5);
}

TEST(BuildObject, KeepsPagesWithinTheTarget) {
  const TriangleSoup soup = testing::random_soup(20000, 0.02f);
  for (const uint32_t size : kSizes) {
    for (const auto& treelet : build(soup, size).sink.treelets) EXPECT_LE(treelet.geometry.size(), size);
  }
}

TEST(BuildObject, StopsWithTheErrorOfTheSink) {
  MemorySink sink(3);
  const Result<BuiltObject> object = build_object(testing::random_soup(20000, 0.02f), {4u << 10}, nullptr, sink);
  ASSERT_FALSE(object.ok());
  EXPECT_EQ(object.error().code, ErrorCode::kStorage);
  EXPECT_EQ(sink.treelets.size(), 3u);
}

TEST(BuildObject, RefusesTreeletSizesOutOfRange) {
  MemorySink sink;
  for (const uint32_t size : {0u, kMinTreeletBytes - 1, kMaxTreeletBytes + 1}) {
    EXPECT_FALSE(build_object(testing::random_soup(10, 0.1f), {size}, nullptr, sink).ok());
  }
}

TEST(BuildObject, SahCostOfOneLeafIsOneNodeAndOneLeaf) {
  // The top node and the leaf have the root's box: one test of boxes and one of triangles.
  EXPECT_DOUBLE_EQ(build(testing::random_soup(1, 0.5f), 4u << 10).object.sah_cost, 2.0);
}

}  // namespace
}  // namespace shoal
