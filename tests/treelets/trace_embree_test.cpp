// Against Embree, and against daylight: nothing leaks through a closed mesh.
#include <embree3/rtcore.h>
#include <gtest/gtest.h>

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {
namespace {

/// An Embree scene over the same triangles, robust.
class EmbreeScene {
 public:
  explicit EmbreeScene(const std::vector<TestTriangle>& triangles) : device_(rtcNewDevice("threads=1")) {
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * triangles.size()));
    auto* indices = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size()));
    for (size_t i = 0; i < 3 * triangles.size(); ++i) {
      std::memcpy(vertices + 3 * i, &triangles[i / 3].p[i % 3], 12);
      indices[i] = static_cast<uint32_t>(i);
    }
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene_, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene_);
  }
  ~EmbreeScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  /// Primitive hit, or kNoIndex; sets t.
  uint32_t intersect(const Ray& ray, float& t) const {
    RTCRayHit query{};
    query.ray.org_x = ray.origin.x, query.ray.org_y = ray.origin.y, query.ray.org_z = ray.origin.z;
    query.ray.dir_x = ray.direction.x, query.ray.dir_y = ray.direction.y, query.ray.dir_z = ray.direction.z;
    query.ray.tfar = ray.t;
    query.ray.mask = 0xffffffffu;
    query.hit.geomID = query.hit.primID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &query);
    t = query.ray.tfar;
    return query.hit.primID;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

void compare_with_embree(const std::vector<TestTriangle>& triangles, std::mt19937& random) {
  const TestScene scene = make_scene({triangles}, {{0, {}}}, {300, 4});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  const EmbreeScene embree(triangles);
  constexpr int kRays = 30000;
  int hits = 0, differences = 0;
  for (int i = 0; i < kRays; ++i) {
    const Vec3 origin = random_vector(random, 2), target = random_vector(random);
    Ray ray = make_ray(origin, target - origin);
    float t;
    const uint32_t expected = embree.intersect(ray, t);
    trace_scene(tree, scene.pages, ray, trace_treelet);
    hits += ray.hit.valid();
    const bool same_t = ray.hit.valid() && std::abs(ray.t - t) <= 1e-5f * (1 + t);
    differences += expected == RTC_INVALID_GEOMETRY_ID ? ray.hit.valid() : !same_t;
  }
  EXPECT_GT(hits, kRays / 10);
  EXPECT_LE(differences, kRays / 10000);  // rays within rounding of an edge
}

TEST(TraceEmbree, FindsTheSameHitsInSoupsAndMeshes) {
  std::mt19937 random(1);
  compare_with_embree(random_soup(random, 5000, 0.1f), random);
  compare_with_embree(random_soup(random, 3000, 0.5f), random);
  compare_with_embree(closed_mesh(40, 80, 0.2f), random);
}

TEST(TraceLeaks, NoRayLeavesAClosedMeshThroughItsEdgesOrVertices) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const Vec3 shift : {Vec3(0), Vec3(100, -30, 7)}) {
    auto mesh = closed_mesh(60, 120, 0.05f);
    for (auto& t : mesh) {
      for (auto& p : t.p) p += shift;
    }
    const TestScene scene = make_scene({mesh}, {{0, {}}}, {500, 4});
    const TopTree tree(scene.nodes, scene.entries, scene.instances);
    size_t leaks = 0;
    for (int i = 0; i < 100000; ++i) {
      const TestTriangle& t = mesh[random() % mesh.size()];
      const Vec3 origin = shift + random_vector(random, 0.3f);
      const Vec3 target = i % 2 ? t.p[random() % 3] : t.p[0] + (t.p[1] - t.p[0]) * uniform(random);
      Ray ray = make_ray(origin, target - origin);
      trace_scene(tree, scene.pages, ray, trace_treelet);
      leaks += !ray.hit.valid();
    }
    EXPECT_EQ(leaks, 0u);
  }
}

}  // namespace
}  // namespace shoal::testing
