// Positions rounded to a grid by the build: nothing moves by more than is said, what was closed stays closed, the file
// shrinks, and no chunk, treelet, thread or order changes what comes of it.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "engine/position_grid.h"
#include "engine/render.h"
#include "tests/engine/built_scene.h"
#include "tests/support/sample_soups.h"
#include "tests/support/test_meshes.h"

namespace shoal::testing {
namespace {

struct Cut {
  uint64_t chunk_triangles = 0;
  uint32_t treelet_bytes = 256u << 10;
};

SceneBuildOptions with(PositionPrecision precision, const Cut& cut = {}) {
  SceneBuildOptions options;
  options.positions = precision;
  options.chunk_triangles = cut.chunk_triangles;
  options.treelet_bytes = cut.treelet_bytes;
  return options;
}

constexpr PositionPrecision kRounded[] = {PositionPrecision::k21, PositionPrecision::k16};

TEST(PositionGrid, NothingIsRoundedBeyondWhatFloatsHold) {
  for (const PositionPrecision precision : {PositionPrecision::k16, PositionPrecision::k21}) {
    Bounds3 bounds;
    bounds.include(Vec3(0));
    bounds.include(Vec3(std::numeric_limits<float>::max(), 1, 1));
    float corners[] = {std::numeric_limits<float>::max(), 1, 1};
    PositionGrid::of(precision, bounds).round(corners);
    for (const float x : corners) EXPECT_TRUE(std::isfinite(x));
  }
}

TEST(PositionGrid, NamesAndParsesEveryPrecision) {
  for (const PositionPrecision precision : kPositionPrecisions) {
    const auto parsed = parse_position_precision(position_precision_name(precision));
    ASSERT_TRUE(parsed.ok());
    EXPECT_EQ(parsed.value(), precision);
  }
  for (const char* name : {"", "20", "21 ", "Exact", "0"}) {
    const auto parsed = parse_position_precision(name);
    ASSERT_FALSE(parsed.ok()) << name;
    EXPECT_EQ(parsed.error().code, ErrorCode::kUsage);
  }
}

TEST(PositionGrid, IsAsFineAsAskedAndExactInFloat) {
  Numbers numbers(3);
  for (const PositionPrecision precision : kRounded) {
    const double cells = std::ldexp(1.0, static_cast<int>(precision));
    for (const float extent : {1e-30f, 1e-3f, 1.0f, 1000.0f, 3e30f}) {
      for (const float away : {0.0f, 0.3f, 2.0f, 40.0f, 1e5f, 1e9f}) {
        const float lo = away * extent, hi = lo + extent;
        const Bounds3 bounds{Vec3(lo), Vec3(hi, hi, lo)};
        const PositionGrid grid = PositionGrid::of(precision, bounds);
        if (!(hi > lo)) {
          EXPECT_EQ(grid.step, 0) << "no extent";
          continue;
        }
        ASSERT_GT(grid.step, 0);
        int exponent;
        EXPECT_EQ(std::frexp(grid.step, &exponent), 0.5f) << "a power of two";
        EXPECT_LE(hi / grid.step, 0x1p23f);
        const double wanted = (double{hi} - lo) / cells;
        EXPECT_GE(grid.step, wanted);
        EXPECT_EQ(grid.far_out, double{grid.step} >= 2 * wanted) << extent << " " << away;
        for (int i = 0; i < 200; ++i) {
          const float x = numbers.uniform(lo, hi);
          float rounded = x;
          grid.round({&rounded, 1});
          EXPECT_LE(std::abs(double{rounded} - x), 0.5 * grid.step);
          const double steps = double{rounded} / grid.step;
          EXPECT_EQ(steps, std::floor(steps));
          EXPECT_LE(std::abs(steps), 0x1p23);
          EXPECT_EQ(static_cast<float>(static_cast<int32_t>(steps)) * grid.step, rounded);
        }
      }
    }
  }
}

TEST(PositionGrid, LeavesWhatItCannotRound) {
  EXPECT_EQ(PositionGrid::of(PositionPrecision::kExact, {Vec3(0), Vec3(1)}).step, 0);
  EXPECT_EQ(PositionGrid::of(PositionPrecision::k16, {}).step, 0) << "nothing there";
  EXPECT_EQ(PositionGrid::of(PositionPrecision::k16, {Vec3(0), Vec3(1e-36f)}).step, 0) << "steps too small";
  float zeros[] = {-0.0f, -1e-9f, 1e-9f};
  PositionGrid::of(PositionPrecision::k16, {Vec3(0), Vec3(1)}).round(zeros);
  for (const float zero : zeros) EXPECT_EQ(std::signbit(zero) || zero != 0, false);
}

TEST(PositionGrid, TheFarthestShiftIsThatOfTheWorstCorner) {
  EXPECT_NEAR(farthest_shift(2, {}), std::sqrt(3.0), 1e-6);
  Affine3 flat;
  flat.column_x = {3, 0, 0}, flat.column_y = {-4, 0, 0}, flat.column_z = {0, 0, 0};
  EXPECT_NEAR(farthest_shift(1, flat), 3.5, 1e-6) << "(1, -1) goes farther than (1, 1)";
  EXPECT_EQ(farthest_shift(0, {}), 0);
}

/// A bumpy ball in `parts` meshes with a node each, which share vertices in world space.
void save_ball(MemoryFileSystem& fs, uint32_t rows, uint32_t parts, const Vec3& center = Vec3(0)) {
  const std::vector<TestTriangle> mesh = closed_mesh(rows, 2 * rows, 0.2f);
  WrittenScene scene;
  for (uint32_t part = 0; part < parts; ++part) {
    std::vector<float> positions;
    for (size_t i = part; i < mesh.size(); i += parts) {
      for (const Vec3& p : mesh[i].p) positions.insert(positions.end(), {p.x, p.y, p.z});
    }
    const uint32_t accessor = scene.add_floats(3, positions);
    scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", accessor}}}})},
                    {"translation", {center.x, center.y, center.z}}});
  }
  scene.save(fs);
}

using Point = std::array<float, 3>;

/// Oriented edges that nothing closes: none, for a mesh without a boundary, however many triangles were dropped because
/// two corners fell together.
size_t open_edges(const std::vector<ReadTriangle>& triangles) {
  std::map<std::pair<Point, Point>, int> edges;
  for (const ReadTriangle& t : triangles) {
    Point p[3];
    for (size_t k = 0; k < 3; ++k) std::copy_n(t.position + 3 * k, 3, p[k].begin());
    for (size_t k = 0; k < 3; ++k) {
      const Point &a = p[k], &b = p[(k + 1) % 3];
      if (a < b) ++edges[{a, b}];
      if (b < a) --edges[{b, a}];
    }
  }
  return static_cast<size_t>(std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second != 0; }));
}

TEST(PositionPrecision, AClosedMeshStaysClosedInAnyChunksAndTreelets) {
  for (const Vec3 center : {Vec3(0), Vec3(3, 100, -7)}) {
    MemoryFileSystem fs;
    save_ball(fs, 60, 3, center);
    for (const PositionPrecision precision : kRounded) {
      for (const Cut& cut : {Cut{0, 256u << 10}, Cut{0, 4u << 10}, Cut{900, 4u << 10}, Cut{3000, 16u << 10}}) {
        const BuiltScene built = build_and_open(fs, with(precision, cut));
        ASSERT_EQ(built.objects.size(), 1u);
        EXPECT_EQ(open_edges(built.objects[0]), 0u) << position_precision_name(precision) << " " << cut.chunk_triangles;
      }
    }
  }
}

TEST(PositionPrecision, DropsWhatRoundsToNothingAndStaysClosed) {
  MemoryFileSystem fs;
  save_ball(fs, 100, 2, {30000, 0, 0});  // two units in the last place: steps of 2^-8
  const BuiltScene exact = build_and_open(fs);
  const BuiltScene built = build_and_open(fs, with(PositionPrecision::k16));
  const BuiltScene chunked = build_and_open(fs, with(PositionPrecision::k16, {1500, 4u << 10}));
  EXPECT_EQ(built.report.position_step, 0x1p-8f);
  EXPECT_GT(built.report.degenerate_count, exact.report.degenerate_count);
  EXPECT_EQ(built.report.degenerate_count, chunked.report.degenerate_count);
  EXPECT_EQ(built.report.degenerate_count + built.report.triangles_count,
            exact.report.degenerate_count + exact.report.triangles_count);
  EXPECT_EQ(open_edges(built.objects[0]), 0u);
  EXPECT_EQ(open_edges(chunked.objects[0]), 0u);
  ASSERT_EQ(built.report.warnings.size(), exact.report.warnings.size() + 1) << "coarser than asked, and said";
  EXPECT_NE(built.report.warnings.back().find("coarser than 16 bits"), std::string::npos);
}

/// World, then an object shown twice, turned and scaled.
void save_instances(MemoryFileSystem& fs) {
  WrittenScene scene;
  const TriangleSoup ground = grid_soup(40), stone = random_soup(400, 0.05f);
  scene.json["materials"] = {{{"name", "plain"}}, {{"name", "lamp"}, {"emissiveFactor", {1, 2, 3}}}};
  const uint32_t flat = scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, ground.positions)}}}});
  const uint32_t rock = scene.add_mesh(
      {{"attributes", {{"POSITION", scene.add_floats(3, stone.positions)}}}, {"material", 1}});
  scene.add_node({{"mesh", flat}, {"scale", {30, 30, 30}}});
  scene.add_node({{"mesh", rock}, {"rotation", {0.5, 0.5, 0.5, 0.5}}, {"scale", {7, -7, 0.1}}});
  scene.add_node({{"mesh", rock}, {"translation", {5, 1, 5}}});
  scene.save(fs);
}

TEST(PositionPrecision, NoVertexMovesByMoreThanIsSaid) {
  MemoryFileSystem fs;
  save_instances(fs);
  const BuiltScene exact = build_and_open(fs);
  EXPECT_EQ(exact.scene.header.position_bits, 0u);
  EXPECT_EQ(exact.scene.header.position_error, 0.0f);
  for (const PositionPrecision precision : kRounded) {
    const BuiltScene built = build_and_open(fs, with(precision));
    const SceneHeader& header = built.scene.header;
    EXPECT_EQ(header.position_bits, static_cast<uint32_t>(precision));
    EXPECT_EQ(header.position_step, built.report.position_step);
    EXPECT_EQ(header.position_error, built.report.position_error);
    double farthest = 0;
    for (const Instance& instance : built.scene.top_tree.instances()) {
      const auto &before = exact.objects[instance.object], &after = built.objects[instance.object];
      std::map<uint32_t, const ReadTriangle*> by_id;
      for (const ReadTriangle& t : before) by_id[t.primitive] = &t;
      for (const ReadTriangle& t : after) {
        for (int k = 0; k < 9; k += 3) {
          double moved[3] = {};
          const Affine3& m = instance.object_to_world;
          for (int axis = 0; axis < 3; ++axis) {
            const float* was = by_id.at(t.primitive)->position + k;
            const double x = double{t.position[k]} - was[0], y = double{t.position[k + 1]} - was[1],
                         z = double{t.position[k + 2]} - was[2];
            moved[axis] = m.column_x[axis] * x + m.column_y[axis] * y + m.column_z[axis] * z;
          }
          farthest = std::max(farthest, std::hypot(moved[0], moved[1], moved[2]));
        }
      }
    }
    EXPECT_LE(farthest, header.position_error);
    EXPECT_GT(farthest, 0.4 * header.position_error) << "a bound that says something";
  }
}

TEST(PositionPrecision, TheFileShrinks) {
  MemoryFileSystem fs;
  WrittenScene scene;
  TriangleSoup soup = grid_soup(150);
  add_triangle(soup, {10, 0, 0}, {10, 1, 0}, {10, 0, 1});  // a small part of the scene holds its detail
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, soup.positions)}}}})}});
  scene.save(fs);
  const BuiltScene exact = build_and_open(fs), fine = build_and_open(fs, with(PositionPrecision::k21)),
                   coarse = build_and_open(fs, with(PositionPrecision::k16));
  ASSERT_EQ(exact.report.triangles_count, coarse.report.triangles_count);
  const auto per_triangle = [](const BuiltScene& built) {
    return static_cast<double>(built.report.geometry_bytes) / static_cast<double>(built.report.triangles_count);
  };
  RecordProperty("exact_bytes_a_triangle", std::to_string(per_triangle(exact)));
  RecordProperty("21_bytes_a_triangle", std::to_string(per_triangle(fine)));
  RecordProperty("16_bytes_a_triangle", std::to_string(per_triangle(coarse)));
  EXPECT_LT(per_triangle(fine), 0.95 * per_triangle(exact));
  EXPECT_LT(per_triangle(coarse), 0.8 * per_triangle(exact));
  EXPECT_LT(fine.report.file_bytes, exact.report.file_bytes);
  EXPECT_LT(coarse.report.file_bytes, fine.report.file_bytes);
}

std::vector<float> picture_of(FileSystem& fs, const Scene& scene, Order order, unsigned threads) {
  PictureOptions picture;
  picture.width = 40, picture.height = 32, picture.samples = 2;
  picture.shading.bounces = 3;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(0.5f), {}};
  ExecutionOptions execution;
  execution.order = order;
  execution.threads = threads;
  const auto result = render(fs, scene, picture, execution);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? result.value().rgba : std::vector<float>{};
}

TEST(PositionPrecision, OneSceneWhateverItIsBuiltAndRenderedWith) {
  MemoryFileSystem fs;
  save_instances(fs);
  for (const PositionPrecision precision : kRounded) {
    const BuiltScene whole = build_and_open(fs, with(precision));
    const std::vector<float> expected = picture_of(fs, whole.scene, Order::kDepthFirst, 1);
    for (const Cut& cut : {Cut{0, 4u << 10}, Cut{500, 16u << 10}, Cut{77, 256u << 10}}) {
      const BuiltScene other = build_and_open(fs, with(precision, cut));
      EXPECT_EQ(other.report.position_step, whole.report.position_step);
      EXPECT_EQ(other.report.degenerate_count, whole.report.degenerate_count);
      ASSERT_EQ(other.objects.size(), whole.objects.size());
      for (size_t o = 0; o < whole.objects.size(); ++o) {
        ASSERT_EQ(other.objects[o].size(), whole.objects[o].size());
        for (size_t i = 0; i < whole.objects[o].size(); ++i) {
          EXPECT_EQ(std::memcmp(other.objects[o][i].position, whole.objects[o][i].position, 36), 0);
        }
      }
      ASSERT_EQ(other.scene.emitters.size(), whole.scene.emitters.size());
      EXPECT_EQ(std::memcmp(other.scene.emitters.data(), whole.scene.emitters.data(),
                            whole.scene.emitters.size() * sizeof(Emitter)), 0);
      for (const Order order : {Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid}) {
        EXPECT_EQ(picture_of(fs, other.scene, order, 3), expected)
            << cut.chunk_triangles << " " << cut.treelet_bytes << " " << order_name(order);
      }
    }
  }
}

TEST(PositionPrecision, TheSameBytesOnAnyNumberOfThreadsAndAnotherKeyForEachPrecision) {
  MemoryFileSystem fs;
  save_instances(fs);
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 4);
  std::vector<uint64_t> keys;
  for (const PositionPrecision precision : kPositionPrecisions) {
    SceneBuildOptions options = with(precision, {300});
    keys.push_back(build_cache_key(fs, "scene.gltf", options).value());
    std::vector<std::byte> first;
    for (const unsigned threads : {1u, 4u}) {
      options.threads = threads;
      ASSERT_TRUE(build_scene(fs, "scene.gltf", "scene.shoal", options).ok());
      const std::vector<std::byte> bytes = fs.contents("scene.shoal");
      if (first.empty()) first = bytes;
      EXPECT_EQ(first == bytes, true) << threads;
    }
  }
  EXPECT_NE(keys[0], keys[1]);
  EXPECT_NE(keys[1], keys[2]);
  EXPECT_NE(keys[0], keys[2]);
}

}  // namespace
}  // namespace shoal::testing
