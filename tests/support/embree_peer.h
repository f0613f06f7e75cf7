// Embree over the same triangles, as it comes or robust, beside ours in tests and bench. One thread.
#pragma once

#include <embree3/rtcore.h>

#include <cstring>
#include <vector>

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {

class EmbreePeer {
 public:
  EmbreePeer(const std::vector<TestTriangle>& triangles, bool robust) : device_(rtcNewDevice("threads=1")) {
    scene_ = rtcNewScene(device_);
    if (robust) rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
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
  EmbreePeer(const EmbreePeer&) = delete;
  EmbreePeer& operator=(const EmbreePeer&) = delete;
  ~EmbreePeer() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }

  /// The triangle hit, or kNoIndex; sets t.
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
  size_t misses(const std::vector<Ray>& rays) const {
    size_t missed = 0;
    float t;
    for (const Ray& ray : rays) missed += intersect(ray, t) == kNoIndex ? 1 : 0;
    return missed;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

}  // namespace shoal::testing
