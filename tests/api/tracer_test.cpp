// The library as a program sees it: only its own headers are included here, but for building a scene to trace.
#include "shoal/tracer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <thread>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "tests/support/temporary_folder.h"

namespace shoal::api {
namespace {

using ::testing::HasSubstr;

constexpr Order kOrders[] = {Order::kAuto, Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid};

/// A generated scene with instances and holes, built.
class ApiTracer : public ::testing::Test {
 protected:
  ApiTracer() : path_(folder_ / "scene.shoal") {
    GenerateOptions generate;
    generate.kind = "instances";
    generate.triangles = 30000;
    generate.out_dir = folder_ / "source";
    const auto source = generate_scene(posix_file_system(), generate);
    EXPECT_TRUE(source.ok()) << source.error().message;
    SceneBuildOptions options;
    options.treelet_bytes = 8u << 10;
    EXPECT_TRUE(build_scene(posix_file_system(), source.value().gltf_path, path_, options).ok());
  }

  Scene open() const {
    auto scene = Scene::open(path_, true);
    EXPECT_TRUE(scene.ok()) << scene.error().message;
    return std::move(scene).value();
  }

  /// From all over the box of the scene, to all sides; of each ten one that is no ray.
  static std::vector<Ray> rays_in(const Bounds& box, size_t count) {
    std::vector<Ray> rays(count);
    uint32_t state = 1;
    const auto uniform = [&] { return static_cast<float>((state = state * 1664525u + 1013904223u) >> 8) * 0x1p-24f; };
    for (size_t i = 0; i < count; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        rays[i].origin[axis] = box.lower[axis] + uniform() * (box.upper[axis] - box.lower[axis]);
        rays[i].direction[axis] = uniform() - 0.5f;
      }
      rays[i].seed = static_cast<uint32_t>(i);
      if (i % 3 == 0) rays[i].t_max = 10;
      if (i % 10 == 9) rays[i].direction[1] = std::nanf("");
    }
    return rays;
  }

  static bool same(const std::vector<Hit>& a, const std::vector<Hit>& b) {
    if (a.size() != b.size()) return false;
    for (size_t i = 0; i < a.size(); ++i) {
      if (a[i].t != b[i].t || a[i].u != b[i].u || a[i].v != b[i].v || a[i].instance != b[i].instance ||
          a[i].object != b[i].object || a[i].primitive != b[i].primitive || a[i].hit != b[i].hit) {
        return false;
      }
    }
    return true;
  }

  const shoal::testing::TemporaryFolder folder_;
  const std::string path_;
};

TEST_F(ApiTracer, TellsOfTheSceneThatItOpened) {
  const Scene scene = open();
  EXPECT_GT(scene.triangle_count(), 25000u);
  EXPECT_GT(scene.instance_count(), 10u);
  EXPECT_GT(scene.page_bytes(), 100000u);
  EXPECT_GT(scene.resident_bytes(), 1000u);
  for (int axis = 0; axis < 3; ++axis) EXPECT_LT(scene.bounds().lower[axis], scene.bounds().upper[axis]);
  EXPECT_STRNE(version(), "");
}

TEST_F(ApiTracer, GivesTheSameHitsInEveryOrderWithOneRayOrManyAtOnce) {
  const Scene scene = open();
  const std::vector<Ray> rays = rays_in(scene.bounds(), 5000);
  std::vector<Hit> expected, expected_any;
  for (const Order order : kOrders) {
    for (const unsigned threads : {1u, 3u}) {
      TracerOptions options;
      options.order = order, options.threads = threads;
      options.barycentrics = true;
      auto tracer = Tracer::create(scene, options);
      ASSERT_TRUE(tracer.ok()) << tracer.error().message;
      std::vector<Hit> closest(rays.size()), any(rays.size());
      const auto report = tracer.value().trace(rays, closest);
      ASSERT_TRUE(report.ok()) << report.error().message;
      ASSERT_TRUE(tracer.value().trace(rays, any, Query::kAny).ok());
      if (expected.empty()) expected = closest, expected_any = any;
      EXPECT_TRUE(same(closest, expected)) << static_cast<int>(order);
      EXPECT_TRUE(same(any, expected_any)) << static_cast<int>(order);
      EXPECT_EQ(report.value().rays, rays.size());
      EXPECT_EQ(report.value().refused, rays.size() / 10);
      EXPECT_GT(report.value().hits, 500u);
      EXPECT_NE(report.value().order, Order::kAuto);
      EXPECT_TRUE(order == Order::kAuto || report.value().order == order);
      EXPECT_GT(report.value().page_loads, 0u);
      EXPECT_GT(report.value().disk_read_bytes, 0u);
      EXPECT_GT(report.value().triangle_tests, 0u);
    }
  }
  for (size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(expected[i].hit, expected_any[i].hit) << i;
    if (!expected[i].hit) continue;
    EXPECT_TRUE(expected[i].u >= 0 && expected[i].v >= 0 && expected[i].u + expected[i].v <= 1.000001f);
    EXPECT_LT(expected[i].instance, scene.instance_count());
    EXPECT_GT(expected[i].object, 0u);
  }
  auto tracer = Tracer::create(scene, {.order = Order::kDepthFirst, .threads = 1, .barycentrics = true});
  ASSERT_TRUE(tracer.ok());
  for (size_t i = 0; i < 100; ++i) {
    std::vector<Hit> one(1);
    ASSERT_TRUE(tracer.value().trace({&rays[i], 1}, one).ok());
    EXPECT_TRUE(same(one, {expected[i]})) << i;
  }
}

TEST_F(ApiTracer, KeepsPagesFromBatchToBatchAndTheSceneAsLongAsItNeedsIt) {
  std::optional<Scene> scene(open());
  const std::vector<Ray> rays = rays_in(scene->bounds(), 3000);
  auto tracer = Tracer::create(*scene);
  ASSERT_TRUE(tracer.ok());
  scene.reset();
  std::vector<Hit> first(rays.size()), second(rays.size());
  const auto cold = tracer.value().trace(rays, first);
  const auto warm = tracer.value().trace(rays, second);
  ASSERT_TRUE(cold.ok() && warm.ok());
  EXPECT_GT(cold.value().page_loads, 0u);
  EXPECT_EQ(warm.value().page_loads, 0u);
  EXPECT_EQ(warm.value().disk_read_bytes, 0u);
  EXPECT_TRUE(same(first, second));
}

TEST_F(ApiTracer, WorksUnderACapAndNamesTheSmallest) {
  const Scene scene = open();
  const std::vector<Ray> rays = rays_in(scene.bounds(), 2000);
  auto refused = Tracer::create(scene, {.max_memory_bytes = 1u << 20});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kMemoryCap);
  EXPECT_THAT(refused.error().message, HasSubstr("smallest"));
  // What the program keeps for itself counts.
  EXPECT_TRUE(Tracer::create(scene, {.max_memory_bytes = 2ull << 30}).ok());
  EXPECT_FALSE(Tracer::create(scene, {.max_memory_bytes = 2ull << 30, .reserved_bytes = 2ull << 30}).ok());
}

TEST_F(ApiTracer, AnswersErrorsWithCodeAndSentence) {
  const auto missing = Scene::open(folder_ / "missing.shoal");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInput);
  EXPECT_THAT(missing.error().message, HasSubstr("missing.shoal"));
  std::ofstream(folder_ / "text.shoal") << "no scene";
  EXPECT_FALSE(Scene::open(folder_ / "text.shoal").ok());

  const Scene scene = open();
  auto tracer = Tracer::create(scene);
  ASSERT_TRUE(tracer.ok());
  std::vector<Hit> hits(3);
  const auto wrong = tracer.value().trace(std::vector<Ray>(4), hits);
  ASSERT_FALSE(wrong.ok());
  EXPECT_EQ(wrong.error().code, ErrorCode::kUsage);
  EXPECT_TRUE(tracer.value().trace({}, {}).ok());
  const std::atomic<bool> stop{true};
  const auto stopped = tracer.value().trace(std::vector<Ray>(3), hits, Query::kClosest, &stop);
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.error().code, ErrorCode::kStopped);
}

TEST_F(ApiTracer, ServesSeveralThreadsAtOnce) {
  const Scene scene = open();
  const std::vector<Ray> rays = rays_in(scene.bounds(), 1000);
  auto shared = Tracer::create(scene, {.threads = 2});
  ASSERT_TRUE(shared.ok());
  std::vector<Hit> expected(rays.size());
  ASSERT_TRUE(shared.value().trace(rays, expected).ok());
  std::vector<std::thread> threads;
  std::vector<std::vector<Hit>> found(4, std::vector<Hit>(rays.size()));
  for (size_t i = 0; i < found.size(); ++i) {
    threads.emplace_back([&, i] {
      if (i % 2 == 0) {
        EXPECT_TRUE(shared.value().trace(rays, found[i]).ok());
      } else {
        auto own = Tracer::create(scene, {.threads = 1});
        EXPECT_TRUE(own.ok() && own.value().trace(rays, found[i]).ok());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const std::vector<Hit>& hits : found) EXPECT_TRUE(same(hits, expected));
}

}  // namespace
}  // namespace shoal::api
