// The record of a render, where one is asked for: what it did over time, how hot its treelets were, and a trace of its
// threads (engine/trace_events.h). Made by bins, handed to render() as ExecutionOptions::record; changes no bit of the
// picture. One render at a time.
//
// Properties and assumptions
//   memory     bytes(): does not depend on scene or time; part of the memory plan (engine/memory_plan).
//   threads    begin() and end() by the thread that renders, while no other works; thread(i) by the i-th of them; watch()
//              and the reads ahead by any.
//   cost       off: a test of a pointer where something would be noted. On: see engine/thread_record.h and
//              engine/render_timeline.h.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/render_timeline.h"
#include "engine/thread_record.h"
#include "io/page_cache.h"

namespace shoal {

struct Scene;

/// What waits in queues.
struct QueueOccupancy {
  uint64_t rays_waiting_count = 0;      ///< rays and paths
  uint64_t treelets_waiting_count = 0;  ///< that have any
};

/// What is left when the render is over.
struct RenderCourse {
  std::vector<TimelineSample> timeline;
  double interval_seconds = 0;  ///< between samples
  bool has_queues = false;      ///< the order kept some: else nothing ever waits
  TreeletHeat heat = TreeletHeat(0);
};

class RenderRecord {
 public:
  RenderRecord();
  ~RenderRecord();
  RenderRecord(const RenderRecord&) = delete;
  RenderRecord& operator=(const RenderRecord&) = delete;
  /// The next render writes a trace. Fails with: kStorage.
  Status open_trace(FileSystem& fs, const std::string& path);
  /// Memory of a record of so many threads that may read `read_depth` pages ahead.
  static uint64_t bytes(unsigned threads, unsigned read_depth);

  /// `page_treelets`: of every page of the file (engine/treelet_scheduler.h). `start_ticks`, `start_seconds`: when the render
  /// began. What is passed lives until end(). Fails with: kMemoryCap.
  Status begin(const Scene& scene, std::span<const TreeletId> page_treelets, PageCache& cache, unsigned threads, unsigned read_depth,
               uint64_t start_ticks, double start_seconds);
  /// Settles the clocks, of all threads. Requires: nothing is being read ahead.
  void end(std::span<PhaseClock> clocks);

  ThreadRecord& thread(unsigned index) { return *threads_[index]; }
  /// From now on this says what waits; empty: nothing does, and what was there before is not asked any more.
  void watch(std::function<QueueOccupancy()> queues);
  /// Reads ahead, by whoever holds the scheduler's lock.
  void read_started(TreeletId treelet);
  void read_finished(PageId page);

  /// After end().
  RenderCourse take_course() { return std::move(course_); }
  /// After the render, whether it failed or not; without a trace nothing. Fails with: kStorage (the trace could not be
  /// written).
  Status finish_trace();

 private:
  struct Reads;
  TimelineSample look();
  void trace_sample(const TimelineSample& sample);

  std::unique_ptr<TraceFile> trace_;  ///< or none
  const uint64_t made_ticks_;
  const double made_seconds_;
  TraceClock clock_;
  double start_seconds_ = 0;
  const Scene* scene_ = nullptr;
  std::span<const TreeletId> page_treelets_;
  PageCache* cache_ = nullptr;
  std::vector<std::unique_ptr<ThreadRecord>> threads_;
  std::unique_ptr<Reads> reads_;
  std::unique_ptr<TraceBuffer> samples_buffer_;  ///< of the timeline's thread, with a trace
  std::mutex queues_mutex_;                      ///< guards the next two
  std::function<QueueOccupancy()> queues_;
  bool has_queues_ = false;
  TimelineThread timeline_;
  RenderCourse course_;
};

/// Records a render from here to the end of the scope, whatever ends it; with none nothing.
class RecordedScope {
 public:
  RecordedScope(RenderRecord* record, std::vector<PhaseClock>& clocks) : record_(record), clocks_(clocks) {}
  ~RecordedScope() {
    if (record_ != nullptr) record_->end(clocks_);
  }
  RecordedScope(const RecordedScope&) = delete;
  RecordedScope& operator=(const RecordedScope&) = delete;

 private:
  RenderRecord* record_;
  std::vector<PhaseClock>& clocks_;
};

}  // namespace shoal
