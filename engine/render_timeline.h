// What a render did over time: bytes from the disk, rays, queues and the page cache, looked at now and then by a thread of
// its own, so that no order knows of it. Called by engine/render_record.
//
// Properties and assumptions
//   memory     RenderTimeline::kCapacity samples. When they are full every second one goes and the interval doubles: a
//              render of any length has between half of them and all.
//   threads    TimelineThread calls `look` from its own thread, one call at a time, none after stop().
//   cost       one look an interval: 2 ms at first, and never more than 2 % of the time of a core.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "io/result.h"

namespace shoal {

// X(name, unit, sentence)
#define SHOAL_TIMELINE_COLUMNS(X)                                                                       \
  X(disk_read_bytes, "bytes", "asked of the disk since the render began")                               \
  X(decoded_bytes, "bytes", "of pages after decompression, since the render began")                     \
  X(rays_traced_count, "rays", "begun since the render began")                                          \
  X(samples_done_count, "samples", "paths ended since the render began")                                \
  X(paths_in_flight_count, "paths", "begun and not ended")                                              \
  X(rays_waiting_count, "rays", "rays and paths that wait in queues for a treelet")                     \
  X(treelets_waiting_count, "treelets", "that have rays or paths waiting")                              \
  X(cache_bytes, "bytes", "of the page cache: resident pages, pages being read, buffers kept for the next")

struct TimelineSample {
  double seconds = 0;  ///< since the render began
#define SHOAL_DECLARE(name, unit, sentence) uint64_t name = 0;
  SHOAL_TIMELINE_COLUMNS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};

class RenderTimeline {
 public:
  static constexpr size_t kCapacity = 512;
  static constexpr double kFirstIntervalSeconds = 2e-3;

  RenderTimeline() { samples_.reserve(kCapacity); }
  /// Keeps the sample unless it comes too early. Requires: seconds never fall.
  void add(const TimelineSample& sample);
  /// Keeps it in any case: how things stood at the end.
  void add_last(const TimelineSample& sample);
  const std::vector<TimelineSample>& samples() const { return samples_; }
  double interval_seconds() const { return interval_seconds_; }

 private:
  void keep(const TimelineSample& sample);
  std::vector<TimelineSample> samples_;
  double interval_seconds_ = kFirstIntervalSeconds;
};

class TimelineThread {
 public:
  TimelineThread() = default;
  ~TimelineThread() { stop(); }
  TimelineThread(const TimelineThread&) = delete;
  TimelineThread& operator=(const TimelineThread&) = delete;

  /// Looks now, then again and again. `most_seconds`: between two looks at most, as far as they are not dear.
  /// Fails with: kMemoryCap (the system gives no thread).
  Status start(std::function<TimelineSample()> look, double most_seconds);
  /// Looks once more and ends. May be called when it was never started.
  void stop();
  /// Between stop() and the next start().
  const RenderTimeline& timeline() const { return timeline_; }

 private:
  void run();
  std::function<TimelineSample()> look_;
  double most_seconds_ = 0;
  std::mutex mutex_;  ///< guards stopped_
  std::condition_variable wake_;
  bool stopped_ = false;
  RenderTimeline timeline_;
  std::thread thread_;
};

}  // namespace shoal
