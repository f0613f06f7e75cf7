#include "bench/embree_scene.h"

#include <fmt/format.h>
#include <xmmintrin.h>

#include "engine/clock.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kFetchAhead = 8;  // as our sorted order has it
constexpr unsigned kPacketRays = 16;

/// Denormal results and operands count as zero while it lives.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040); }
  ~FlushDenormals() { _mm_setcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};

void fill(RTCRay& out, const BenchRay& ray) {
  out.org_x = ray.origin.x, out.org_y = ray.origin.y, out.org_z = ray.origin.z;
  out.dir_x = ray.direction.x, out.dir_y = ray.direction.y, out.dir_z = ray.direction.z;
  out.tnear = 0, out.tfar = ray.t, out.time = 0;
  out.mask = 0xffffffffu, out.id = 0, out.flags = 0;
}

RayAnswer answer_of_hit(float t, unsigned primitive) {
  return primitive == RTC_INVALID_GEOMETRY_ID ? RayAnswer{} : RayAnswer{t, primitive};
}
/// Embree says "occluded" by tfar = -infinity.
RayAnswer answer_of_occluded(float t) { return t < 0 ? RayAnswer{0, 0} : RayAnswer{}; }

/// One thread's rays of one run.
class EmbreeTracer {
 public:
  EmbreeTracer(const EmbreeScene& scene, const RaySet& set, const EmbreeRun& run, std::span<RayAnswer> answers)
      : scene_(scene.scene()), set_(set), run_(run), answers_(answers) {
    rtcInitIntersectContext(&context_);
    context_.flags = set.coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  }

  void trace(uint64_t first, uint64_t last) {
    switch (run_.call) {
      case EmbreeCall::kSingle: return trace_single(first, last);
      case EmbreeCall::kPacket: return trace_packets(first, last);
      case EmbreeCall::kStream: return trace_stream(first, last);
    }
  }

 private:
  void trace_single(uint64_t first, uint64_t last) {
    const TeamSorter* sorter = run_.sorter;
    for (uint64_t place = first; place < last; ++place) {
      const uint64_t index = sorter != nullptr ? sorter->ray_at(place) : place;
      if (sorter != nullptr) __builtin_prefetch(&set_.rays[sorter->ray_at(std::min(place + kFetchAhead, last - 1))]);
      alignas(16) RTCRayHit query;
      fill(query.ray, set_.rays[index]);
      if (set_.any_hit) {
        rtcOccluded1(scene_, &context_, &query.ray);
        answers_[index] = answer_of_occluded(query.ray.tfar);
      } else {
        query.hit.geomID = query.hit.primID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene_, &context_, &query);
        answers_[index] = answer_of_hit(query.ray.tfar, query.hit.primID);
      }
    }
  }

  void trace_packets(uint64_t first, uint64_t last) {
    for (; first < last; first += kPacketRays) {
      const auto count = static_cast<unsigned>(std::min<uint64_t>(kPacketRays, last - first));
      alignas(64) int valid[kPacketRays];
      alignas(64) RTCRayHit16 query;
      for (unsigned i = 0; i < kPacketRays; ++i) {
        const BenchRay& ray = set_.rays[first + std::min(i, count - 1)];
        RTCRay16& out = query.ray;
        out.org_x[i] = ray.origin.x, out.org_y[i] = ray.origin.y, out.org_z[i] = ray.origin.z;
        out.dir_x[i] = ray.direction.x, out.dir_y[i] = ray.direction.y, out.dir_z[i] = ray.direction.z;
        out.tnear[i] = 0, out.tfar[i] = ray.t, out.time[i] = 0;
        out.mask[i] = 0xffffffffu, out.id[i] = 0, out.flags[i] = 0;
        query.hit.geomID[i] = query.hit.primID[i] = query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        valid[i] = i < count ? -1 : 0;
      }
      if (set_.any_hit) {
        rtcOccluded16(valid, scene_, &context_, &query.ray);
      } else {
        rtcIntersect16(valid, scene_, &context_, &query);
      }
      for (unsigned i = 0; i < count; ++i) {
        answers_[first + i] = set_.any_hit ? answer_of_occluded(query.ray.tfar[i])
                                           : answer_of_hit(query.ray.tfar[i], query.hit.primID[i]);
      }
    }
  }

  void trace_stream(uint64_t first, uint64_t last) {
    stream_.resize(last - first);
    for (uint64_t i = first; i < last; ++i) {
      RTCRayHit& query = stream_[i - first];
      fill(query.ray, set_.rays[i]);
      query.hit.geomID = query.hit.primID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    }
    const auto count = static_cast<unsigned>(last - first);
    if (set_.any_hit) {
      rtcOccluded1M(scene_, &context_, &stream_[0].ray, count, sizeof(RTCRayHit));
    } else {
      rtcIntersect1M(scene_, &context_, stream_.data(), count, sizeof(RTCRayHit));
    }
    for (uint64_t i = first; i < last; ++i) {
      const RTCRayHit& query = stream_[i - first];
      answers_[i] = set_.any_hit ? answer_of_occluded(query.ray.tfar)
                                 : answer_of_hit(query.ray.tfar, query.hit.primID);
    }
  }

  RTCScene scene_;
  const RaySet& set_;
  const EmbreeRun& run_;
  std::span<RayAnswer> answers_;
  RTCIntersectContext context_;
  std::vector<RTCRayHit> stream_;
};

}  // namespace

EmbreeScene::EmbreeScene(const WorldMesh& mesh, const EmbreeOptions& options)
    : device_(rtcNewDevice(fmt::format("threads={},set_affinity=0", options.build_threads).c_str())) {
  const auto monitor = [](void* total, ssize_t bytes, bool) {
    *static_cast<std::atomic<int64_t>*>(total) += bytes;
    return true;
  };
  rtcSetDeviceMemoryMonitorFunction(device_, monitor, &bytes_);
  scene_ = rtcNewScene(device_);
  const int flags = (options.robust ? RTC_SCENE_FLAG_ROBUST : 0) | (options.compact ? RTC_SCENE_FLAG_COMPACT : 0);
  rtcSetSceneFlags(scene_, static_cast<RTCSceneFlags>(flags));
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_MEDIUM);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.vertices.data(), 0, 12,
                             mesh.vertex_count());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.indices.data(), 0, 12,
                             mesh.triangle_count());
  const double start = now_seconds();
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  build_seconds_ = now_seconds() - start;
}

EmbreeScene::~EmbreeScene() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

TeamSeconds trace_with_embree(const EmbreeScene& scene, const RaySet& set, unsigned threads, const EmbreeRun& run,
                              std::span<RayAnswer> answers) {
  std::atomic<uint64_t> next{0};
  const uint64_t grab = run.call == EmbreeCall::kStream ? run.stream_rays : kRaysPerGrab;
  return run_together(threads, [&](unsigned thread) {
    const FlushDenormals flush;
    if (run.sorter != nullptr) run.sorter->sort(set.rays, thread);
    EmbreeTracer tracer(scene, set, run, answers);
    for (uint64_t first; (first = next.fetch_add(grab)) < set.rays.size();) {
      tracer.trace(first, std::min<uint64_t>(first + grab, set.rays.size()));
    }
  });
}

}  // namespace shoal::bench
