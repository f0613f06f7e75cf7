// The rival: Embree's tree of a mesh, and its ways of tracing rays. Threads take ranges of rays as ours do; Embree's
// own threads only build. Flush-to-zero is on while it traces, as its manual asks. Called by bench/against_embree.
#pragma once

#include <embree3/rtcore.h>

#include <atomic>

#include "bench/memory_orders.h"
#include "bench/ray_sort.h"

namespace shoal::bench {

struct EmbreeOptions {
  bool compact = false;  ///< RTC_SCENE_FLAG_COMPACT: triangles as indices, not as copies of their corners
  bool robust = true;    ///< RTC_SCENE_FLAG_ROBUST: watertight, as our triangle test is
  unsigned build_threads = 1;
};

class EmbreeScene {
 public:
  /// Keeps a reference to `mesh`, whose arrays Embree uses in place.
  EmbreeScene(const WorldMesh& mesh, const EmbreeOptions& options);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  RTCScene scene() const { return scene_; }
  /// What Embree itself holds; vertices and indices are not in it.
  uint64_t bytes() const { return bytes_; }
  double build_seconds() const { return build_seconds_; }

 private:
  RTCDevice device_;
  RTCScene scene_;
  std::atomic<int64_t> bytes_{0};
  double build_seconds_ = 0;
};

enum class EmbreeCall {
  kSingle,   ///< rtcIntersect1
  kPacket,   ///< rtcIntersect16, 16 neighbours at a time
  kStream,   ///< rtcIntersect1M
};

struct EmbreeRun {
  EmbreeCall call = EmbreeCall::kSingle;
  uint64_t stream_rays = 1024;   ///< a call of kStream
  TeamSorter* sorter = nullptr;   ///< not null: kSingle over sorted rays, the sort within the time
};

/// Traces all rays; any-hit rays by the rtcOccluded calls. The context says coherent where the set does.
TeamSeconds trace_with_embree(const EmbreeScene& scene, const RaySet& set, unsigned threads, const EmbreeRun& run,
                              std::span<RayAnswer> answers);

}  // namespace shoal::bench
