// Lists of rays get the answers of brute force, in every order, whatever the cap.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "engine/trace_rays.h"
#include "io/page_cache.h"
#include "tests/engine/built_scene.h"
#include "treelets/ray_space.h"
#include "treelets/triangle_test.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;

/// All that there are, kAuto first.
const std::vector<Order> kOrders = [] {
  std::vector<Order> orders;
  for (uint8_t i = 0; !order_name(static_cast<Order>(i)).empty(); ++i) orders.push_back(static_cast<Order>(i));
  return orders;
}();

/// Triangles all over a box, baked, and a mesh of some that three nodes show.
BuiltScene build_crowd(FileSystem& fs, MemoryFileSystem& memory) {
  WrittenScene scene;
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(0, 1);
  const auto add_crowd = [&](uint32_t triangles) {
    std::vector<float> positions, normals;
    for (uint32_t i = 0; i < triangles; ++i) {
      const float center[3] = {4 * uniform(random), 4 * uniform(random), 4 * uniform(random)};
      for (int corner = 0; corner < 3; ++corner) {
        for (const float c : center) positions.push_back(c + 1.2f * uniform(random));
        normals.insert(normals.end(), {0, 0, 1});  // attributes that no ray should ask for
      }
    }
    const uint32_t position = scene.add_floats(3, positions), normal = scene.add_floats(3, normals);
    return scene.add_mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}}}});
  };
  const uint32_t shared = add_crowd(150);
  scene.add_node({{"mesh", add_crowd(2000)}});
  scene.add_node({{"mesh", shared}, {"translation", {1, 0.5, 3}}, {"scale", {0.7, 1.3, 1}}});
  scene.add_node({{"mesh", shared}, {"translation", {-2, 0, 0}}, {"rotation", {0, 0.6, 0, 0.8}}});
  scene.add_node({{"mesh", shared}, {"scale", {-1, 1, 1}}});
  scene.save(memory);
  SceneBuildOptions options;
  options.threads = 1;
  options.treelet_bytes = 4u << 10;
  return build_and_open(fs, options);
}

class TraceRays : public ::testing::Test {
 protected:
  TraceRays() : built_(build_crowd(fs_, fs_)) {}

  static std::vector<QueryRay> random_rays(size_t count, uint32_t seed = 3) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const auto vector = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
    std::vector<QueryRay> rays(count);
    for (size_t i = 0; i < count; ++i) {
      rays[i].origin = Vec3(2) + 3.0f * vector();
      rays[i].direction = vector() * (i % 3 == 0 ? 100.0f : 0.01f);
      if (i % 4 == 1) rays[i].t_max = 0.3f / glm::length(rays[i].direction);
      if (i % 5 == 2) rays[i].t_min = 1.5f / glm::length(rays[i].direction);
    }
    return rays;
  }

  /// Every triangle of every instance, as the kernels test it.
  RayHit brute_force(const QueryRay& asked, RayQuery query) const {
    Ray ray;
    ray.origin = Vec3(glm::dvec3(asked.origin) + double{asked.t_min} * glm::dvec3(asked.direction));
    ray.direction = asked.direction;
    float t_max = asked.t_max == kRayInfinity ? kRayInfinity : static_cast<float>(double{asked.t_max} - asked.t_min);
    RayHit best;
    const auto instances = built_.scene.top_tree.instances();
    for (uint32_t i = 0; i < instances.size(); ++i) {
      const RaySpace space = to_object_space(ray, instances[i]);
      for (const ReadTriangle& t : built_.objects[instances[i].object]) {
        const auto corner = [&](int k) { return Vec3(t.position[3 * k], t.position[3 * k + 1], t.position[3 * k + 2]); };
        TriangleHit hit;
        if (!(t_max > 0) || !intersect_triangle(space, corner(0), corner(1), corner(2), t_max, hit)) continue;
        if (query == RayQuery::kAny) {
          best.hit |= hit.t < t_max;
        } else if (!best.hit || hit.t < t_max) {
          t_max = hit.t;
          best = {asked.t_min == 0 ? hit.t : static_cast<float>(double{asked.t_min} + hit.t), hit.b1, hit.b2, i,
                  best.object, t.primitive, true};
        }
      }
    }
    return best;
  }

  std::vector<RayHit> trace(const std::vector<QueryRay>& rays, RayQuery query, const TraceOptions& options) {
    auto traced = trace_rays(fs_, built_.scene, rays, query, options);
    EXPECT_TRUE(traced.ok()) << traced.error().message;
    if (!traced.ok()) return {};
    counters_ = traced.value().report.counters;
    return std::move(traced.value().hits);
  }

  static TraceOptions in_order(Order order, unsigned threads = 2) {
    TraceOptions options;
    options.points = true;
    options.execution.order = order;
    options.execution.threads = threads;
    return options;
  }

  MemoryFileSystem fs_;
  BuiltScene built_;
  RenderCounters counters_;
};

TEST_F(TraceRays, EqualBruteForceInEveryOrder) {
  const std::vector<QueryRay> rays = random_rays(3000);
  ASSERT_GT(built_.scene.header.attribute_bytes, 0u);
  for (const RayQuery query : {RayQuery::kClosest, RayQuery::kAny}) {
    std::vector<RayHit> expected;
    for (const QueryRay& ray : rays) expected.push_back(brute_force(ray, query));
    const auto hits = static_cast<size_t>(std::count_if(expected.begin(), expected.end(), [](auto& h) { return h.hit; }));
    EXPECT_GT(hits, rays.size() / 4);
    EXPECT_LT(hits, rays.size() * 9 / 10);
    for (const Order order : kOrders) {
      std::vector<RayHit> found = trace(rays, query, in_order(order));
      ASSERT_EQ(found.size(), rays.size());
      for (size_t i = 0; i < rays.size(); ++i) {
        if (query == RayQuery::kClosest && found[i].hit) {
          ASSERT_EQ(found[i].object, found[i].instance + 1) << i;  // of one baked mesh, and instances after it
        }
        found[i].object = 0;
        ASSERT_TRUE(found[i] == expected[i]) << order_name(order) << ", ray " << i << ": t " << found[i].t << " for "
                                             << expected[i].t;
      }
      EXPECT_EQ(counters_.total().rays_traced_count, rays.size());
      EXPECT_EQ(counters_.total().ray_hits_count, hits);
      EXPECT_EQ(counters_.attribute_loads_count + counters_.texture_loads_count, 0u);
      EXPECT_EQ(counters_.vertices_shaded_count, query == RayQuery::kClosest ? hits : 0);
    }
  }
}

TEST_F(TraceRays, HaveTheSameAnswersWithTheSmallestCacheAndFewInFlight) {
  const std::vector<QueryRay> rays = random_rays(3000);
  for (const RayQuery query : {RayQuery::kClosest, RayQuery::kAny}) {
    const std::vector<RayHit> expected = trace(rays, query, in_order(Order::kHybrid, 1));
    for (const Order order : {Order::kAuto, Order::kQueued, Order::kDepthFirst, Order::kSorted}) {
      for (const unsigned threads : {1u, 3u}) {
        TraceOptions options = in_order(order, threads);
        options.execution.rays_in_flight = 64;
        options.execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*built_.scene.file, threads);
        EXPECT_TRUE(trace(rays, query, options) == expected) << order_name(order) << ", threads " << threads;
        EXPECT_GT(counters_.page_evictions_count, 0u);
      }
    }
  }
}

TEST_F(TraceRays, NeedNoVertexWhereNoPointIsAsked) {
  const std::vector<QueryRay> rays = random_rays(500);
  const std::vector<RayHit> with = trace(rays, RayQuery::kClosest, in_order(Order::kQueued));
  for (const Order order : kOrders) {
    TraceOptions options = in_order(order);
    options.points = false;
    const std::vector<RayHit> without = trace(rays, RayQuery::kClosest, options);
    EXPECT_EQ(counters_.vertices_shaded_count, 0u);
    for (size_t i = 0; i < rays.size(); ++i) {
      RayHit expected = with[i];
      expected.u = expected.v = 0;
      ASSERT_TRUE(without[i] == expected) << order_name(order) << ", ray " << i;
    }
  }
}

TEST_F(TraceRays, OfAnEmptyListHaveNoAnswer) {
  for (const Order order : kOrders) {
    EXPECT_TRUE(trace({}, RayQuery::kClosest, in_order(order)).empty());
    EXPECT_EQ(counters_.total().rays_traced_count, 0u);
  }
}

TEST_F(TraceRays, ThatAreNoRaysMissAndAreCounted) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  QueryRay good = random_rays(64)[0];
  std::vector<QueryRay> rays = random_rays(64);
  while (!brute_force(good, RayQuery::kAny).hit) good = rays.back(), rays.pop_back();
  rays.assign(10, good);
  rays[1].origin.y = kNan;
  rays[2].direction.z = kInf;
  rays[3].direction = Vec3(0);
  rays[4].t_min = -kInf;
  rays[5].t_max = kNan;
  rays[6].t_min = 3e38f, rays[6].direction = Vec3(3e38f);  // begins nowhere
  rays[7].t_max = rays[7].t_min;                           // empty, which is an answer
  rays[8].t_max = -1;
  rays[9].t_max = kInf;
  for (const Order order : kOrders) {
    for (const RayQuery query : {RayQuery::kClosest, RayQuery::kAny}) {
      const auto traced = trace_rays(fs_, built_.scene, rays, query, in_order(order));
      ASSERT_TRUE(traced.ok()) << traced.error().message;
      EXPECT_EQ(traced.value().report.refused_count, 6u);
      for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(traced.value().hits[i].hit, i == 0 || i == 9) << i;
    }
  }
}

TEST_F(TraceRays, AClosestHitMayLieAtTheEndAndAnyHitMustLieBefore) {
  QueryRay ray;
  for (const QueryRay& candidate : random_rays(100)) {
    ray = candidate;
    ray.t_min = 0, ray.t_max = kRayInfinity;
    if (brute_force(ray, RayQuery::kClosest).hit) break;
  }
  const float t = brute_force(ray, RayQuery::kClosest).t;
  const auto until = [&](float t_max) {
    QueryRay cut = ray;
    cut.t_max = t_max;
    return cut;
  };
  const std::vector<QueryRay> rays{until(std::nextafter(t, 0.0f)), until(t), until(std::nextafter(t, kRayInfinity))};
  const auto closest = trace(rays, RayQuery::kClosest, in_order(Order::kDepthFirst));
  EXPECT_FALSE(closest[0].hit);
  EXPECT_TRUE(closest[1].hit && closest[2].hit);
  const auto any = trace(rays, RayQuery::kAny, in_order(Order::kQueued));
  EXPECT_FALSE(any[0].hit || any[1].hit);
  EXPECT_TRUE(any[2].hit);
}

TEST_F(TraceRays, FindPagesOfTheListBeforeInTheCache) {
  const std::vector<QueryRay> rays = random_rays(2000);
  for (const Order order : kOrders) {
    std::vector<RayHit> first(rays.size()), second(rays.size());
    auto tracer = RayTracer::create(fs_, built_.scene, in_order(order));
    ASSERT_TRUE(tracer.ok());
    const auto cold = tracer.value()->trace(rays, RayQuery::kClosest, first);
    const auto warm = tracer.value()->trace(rays, RayQuery::kClosest, second);
    const auto any = tracer.value()->trace(rays, RayQuery::kAny, second);
    ASSERT_TRUE(cold.ok() && warm.ok() && any.ok());
    EXPECT_GT(cold.value().counters.disk_read_bytes, 0u);
    EXPECT_GT(cold.value().counters.treelet_loads_count, 0u);
    EXPECT_EQ(warm.value().counters.disk_read_bytes, 0u) << order_name(order);
    EXPECT_EQ(any.value().counters.treelet_loads_count, 0u);
    EXPECT_EQ(warm.value().counters.total().rays_traced_count, rays.size());
    for (size_t i = 0; i < rays.size(); ++i) ASSERT_EQ(second[i].hit, brute_force(rays[i], RayQuery::kAny).hit);
  }
}

TEST_F(TraceRays, CanBeStoppedAndTracedAgain) {
  const std::vector<QueryRay> rays = random_rays(2000);
  const std::vector<RayHit> expected = trace(rays, RayQuery::kClosest, in_order(Order::kHybrid));
  const std::atomic<bool> stop{true};
  RenderHooks hooks;
  hooks.stop = &stop;
  for (const Order order : kOrders) {
    std::vector<RayHit> hits(rays.size());
    TraceOptions options = in_order(order);
    options.execution.rays_in_flight = 64;
    auto tracer = RayTracer::create(fs_, built_.scene, options);
    ASSERT_TRUE(tracer.ok());
    const auto stopped = tracer.value()->trace(rays, RayQuery::kClosest, hits, hooks);
    ASSERT_FALSE(stopped.ok());
    EXPECT_EQ(stopped.error().code, ErrorCode::kStopped);
    ASSERT_TRUE(tracer.value()->trace(rays, RayQuery::kClosest, hits).ok());
    EXPECT_TRUE(hits == expected) << order_name(order);
  }
}

TEST_F(TraceRays, SayWhichCapWouldWork) {
  TraceOptions options = in_order(Order::kQueued);
  options.execution.max_memory_bytes = 1u << 20;
  const auto traced = trace_rays(fs_, built_.scene, random_rays(10), RayQuery::kAny, options);
  ASSERT_FALSE(traced.ok());
  EXPECT_EQ(traced.error().code, ErrorCode::kMemoryCap);
  EXPECT_THAT(traced.error().message, HasSubstr("smallest"));
  // What the caller keeps is taken from the cap.
  options.execution.max_memory_bytes = 1ull << 30;
  ASSERT_TRUE(trace_rays(fs_, built_.scene, random_rays(10), RayQuery::kAny, options).ok());
  options.kept_bytes = 1ull << 30;
  EXPECT_FALSE(trace_rays(fs_, built_.scene, random_rays(10), RayQuery::kAny, options).ok());
}

TEST(TraceRaysThrough, HolesPassWhereTheyAreCut) {
  MemoryFileSystem fs;
  WrittenScene scene;
  // The left half of the texture is there, the right half is not; one triangle shows both.
  const uint32_t texture = scene.add_texture(fs, 2, 1, {255, 255, 255, 255, 255, 255, 255, 0});
  scene.json["samplers"] = {{{"magFilter", 9728}, {"minFilter", 9728}}};
  scene.json["textures"][texture]["sampler"] = 0;
  scene.json["materials"] = {{{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}},
                             {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.5}}}}}};
  const uint32_t uv = scene.add_floats(2, {0, 0, 1, 0, 0, 1});
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                                                            {"TEXCOORD_0", uv}}}, {"material", 0}})}});
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, {5, 0, 0, 6, 0, 0, 5, 1, 0})}}},
                                           {"material", 1}})}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  const auto at = [](float x, uint32_t seed) { return QueryRay{{x, 0.1f, 1}, 0, {0, 0, -1}, kRayInfinity, seed}; };
  std::vector<QueryRay> rays{at(0.25f, QueryRay::kMiddle), at(0.75f, QueryRay::kMiddle),
                             at(0.75f, QueryRay::kMiddle | QueryRay::kEveryTriangle)};
  for (uint32_t seed = 0; seed < 1000; ++seed) rays.push_back(at(5.25f, seed * 7919));
  for (const Order order : kOrders) {
    TraceOptions options;
    options.execution.order = order;
    const auto cut = trace_rays(fs, built.scene, rays, RayQuery::kClosest, options);
    ASSERT_TRUE(cut.ok());
    EXPECT_TRUE(cut.value().hits[0].hit && !cut.value().hits[1].hit && cut.value().hits[2].hit);
    const auto there = std::count_if(cut.value().hits.begin() + 3, cut.value().hits.end(), [](auto& h) { return h.hit; });
    EXPECT_NEAR(static_cast<double>(there), 500, 80);  // five standard deviations
    options.coverage = false;
    const auto whole = trace_rays(fs, built.scene, rays, RayQuery::kClosest, options);
    ASSERT_TRUE(whole.ok());
    for (const RayHit& hit : whole.value().hits) EXPECT_TRUE(hit.hit);
  }
}

TEST(TraceRaysThrough, WhatMovesIsMetWhereItStandsThen) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(3, {0, 0, 0, 8, 0, 0});
  scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  scene.save(fs);
  SceneBuildOptions build;
  build.pose.time = 0;
  build.pose.shutter = {0, 1};
  const BuiltScene built = build_and_open(fs, build);
  ASSERT_TRUE(built.scene.top_tree.moves());
  const auto at = [](float x, uint32_t seed) { return QueryRay{{x, 0.25f, 1}, 0, {0, 0, -1}, kRayInfinity, seed}; };
  const std::vector<QueryRay> rays{at(0.25f, 0), at(0.25f, QueryRay::kMiddle), at(4.25f, QueryRay::kMiddle),
                                   at(4.25f, 0)};
  for (const Order order : kOrders) {
    TraceOptions options;
    options.points = true;
    options.execution.order = order;
    const auto traced = trace_rays(fs, built.scene, rays, RayQuery::kClosest, options);
    ASSERT_TRUE(traced.ok()) << traced.error().message;
    const std::vector<RayHit>& hits = traced.value().hits;
    EXPECT_TRUE(hits[0].hit && !hits[1].hit && hits[2].hit && !hits[3].hit) << order_name(order);
    EXPECT_NEAR(hits[2].u, 0.25f, 1e-5f);  // where it stands in the middle, 4 further
    EXPECT_NEAR(hits[2].v, 0.25f, 1e-5f);
  }
}

}  // namespace
}  // namespace shoal::testing
