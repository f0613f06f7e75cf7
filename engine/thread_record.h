// What one thread of a render notes for its record (engine/render_record.h): where it stands, the heat of treelets, and,
// with a trace, its phases and the treelets that it has in hand. Called by engine/render_worker, on that thread only, and
// by the record when the thread is done. Nothing here is called unless a record was asked for.
//
// Cost: a visit one addition; the rest once a batch or a page, and note_progress() at most once a millisecond.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <span>

#include "engine/phase_clock.h"
#include "engine/trace_events.h"
#include "engine/treelet_heat.h"
#include "io/page_file.h"

namespace shoal {

/// Counters of a thread that others read while it goes on.
struct LiveCounts {
  uint64_t disk_read_bytes = 0, decoded_bytes = 0, rays_traced_count = 0;
  uint64_t samples_started_count = 0, samples_done_count = 0;
};

class ThreadRecord {
 public:
  /// `trace`: or none. `threads`: that share what a trace may hold.
  /// `page_treelets`: of every page of the file (engine/treelet_scheduler.h); outlives this.
  ThreadRecord(uint32_t treelets_count, std::span<const TreeletId> page_treelets, const TraceClock& clock, TraceFile* trace,
               unsigned thread, unsigned threads);

  void note_batch(PageId geometry) { ++heat_.of(page_treelets_[geometry]).batches_count; }
  void note_visit(TreeletId treelet) { ++heat_.of(treelet).visits_count; }
  void note_load(TreeletId treelet, bool geometry, uint64_t bytes) {
    HeatCell& cell = heat_.of(treelet);
    cell.loads_count += geometry ? 1 : 0;
    cell.load_bytes += bytes;
  }

  /// Whether a millisecond has gone by since the last note_progress().
  bool due(uint64_t now) const { return now - noted_ticks_ >= due_ticks_; }
  /// `more`: what was counted since the last call.
  void note_progress(const LiveCounts& more, PhaseClock& clock, uint64_t now);
  /// Any thread.
  LiveCounts live() const;

  bool traces() const { return trace_.has_value(); }
  // With a trace. `visits`, `decoded_bytes`: counters of the thread, of which differences are shown.
  void begin_hand(TreeletId treelet, uint64_t now, uint64_t visits, uint64_t decoded_bytes);
  void end_hand(uint64_t now, uint64_t bytes, uint64_t visits, uint64_t decoded_bytes);
  /// A page was not there: the thread read it or waited for it. `treelet`: kNoIndex for a texture.
  void note_wait(TreeletId treelet, uint64_t begin, uint64_t end, uint64_t loaded_bytes);

  /// The last of the phases, and what is merged, once the thread is done.
  void finish(PhaseClock& clock, uint64_t now);
  const TreeletHeat& heat() const { return heat_; }

 private:
  /// What only a trace needs.
  struct Trace {
    Trace(TraceFile& file, const TraceClock& clock, unsigned thread, unsigned threads);
    void show_phases(const PhaseClock& clock, uint64_t now);

    TraceBuffer buffer;
    TraceBudget budget;
    TraceRow row;
    uint32_t phase_row;
    uint64_t slice_ticks;
    uint64_t shown_until;
    std::array<uint64_t, kPhaseCount> shown{};  ///< of each phase, ticks
    TreeletId in_hand = kNoIndex;
    uint64_t hand_begin = 0, visits_before = 0, decoded_before = 0;
  };

  std::span<const TreeletId> page_treelets_;
  TreeletHeat heat_;
  uint64_t due_ticks_, noted_ticks_ = 0;
  std::atomic<uint64_t> disk_read_bytes_{0}, decoded_bytes_{0}, rays_traced_count_{0};
  std::atomic<uint64_t> samples_started_count_{0}, samples_done_count_{0};
  std::optional<Trace> trace_;
};

}  // namespace shoal
