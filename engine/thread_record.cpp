#include "engine/thread_record.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {
namespace {

constexpr double kDueSeconds = 1e-3;
/// What all threads together may put into a trace, a second: 4000 pieces of work of about 130 bytes and 830 slices with at
/// most ten phases of 80, so that a minute takes about 70 MB at most, with the reads ahead (engine/render_record.cpp).
constexpr double kPiecesASecond = 4000, kSlicesASecond = 830;
constexpr double kLeastSliceSeconds = 2e-3;

double slice_seconds(unsigned threads) { return std::max(kLeastSliceSeconds, threads / kSlicesASecond); }

/// One writer: no lock.
void add_to(std::atomic<uint64_t>& sum, uint64_t more) {
  sum.store(sum.load(std::memory_order_relaxed) + more, std::memory_order_relaxed);
}

}  // namespace

ThreadRecord::Trace::Trace(TraceFile& file, const TraceClock& clock, unsigned thread, unsigned threads)
    : buffer(file, clock),
      budget(clock, kPiecesASecond / threads),
      row(buffer, budget, 2 * thread + 2, "treelet", "treelets", slice_seconds(threads)),
      phase_row(2 * thread + 1),
      slice_ticks(clock.ticks_of(slice_seconds(threads))),
      shown_until(clock.start_ticks) {
  buffer.name_row(phase_row, fmt::format("thread {}: phases", thread));
  buffer.name_row(phase_row + 1, fmt::format("thread {}: treelets in hand", thread));
}

/// One slice: its phases one after another, each as long as all of its pieces, in a fixed order.
void ThreadRecord::Trace::show_phases(const PhaseClock& clock, uint64_t now) {
  uint64_t at = shown_until;
  for (size_t i = 0; i < kPhaseCount; ++i) {
    // What one phase gave to another after it was shown is missing from it until it has caught up.
    const uint64_t ticks = clock.ticks(static_cast<Phase>(i));
    if (ticks <= shown[i]) continue;
    const uint64_t end = at + std::min(ticks - shown[i], now - at);
    if (end == at) continue;
    buffer.complete(phase_row, kPhaseNames[i], at, end);
    shown[i] += end - at;
    at = end;
  }
  shown_until = now;
}

ThreadRecord::ThreadRecord(uint32_t treelets_count, std::span<const TreeletId> page_treelets, const TraceClock& clock,
                           TraceFile* trace, unsigned thread, unsigned threads)
    : page_treelets_(page_treelets), heat_(treelets_count), due_ticks_(clock.ticks_of(kDueSeconds)) {
  if (trace != nullptr) trace_.emplace(*trace, clock, thread, threads);
}

void ThreadRecord::note_progress(const LiveCounts& more, PhaseClock& clock, uint64_t now) {
  noted_ticks_ = now;
  add_to(disk_read_bytes_, more.disk_read_bytes);
  add_to(decoded_bytes_, more.decoded_bytes);
  add_to(rays_traced_count_, more.rays_traced_count);
  // Ended first: so nobody who reads in between sees fewer begun than ended.
  add_to(samples_started_count_, more.samples_started_count);
  add_to(samples_done_count_, more.samples_done_count);
  if (!trace_ || now < trace_->shown_until + trace_->slice_ticks) return;
  clock.settle(now);
  trace_->show_phases(clock, now);
}

LiveCounts ThreadRecord::live() const {
  LiveCounts counts;
  counts.samples_done_count = samples_done_count_.load(std::memory_order_relaxed);
  counts.samples_started_count = samples_started_count_.load(std::memory_order_relaxed);
  counts.disk_read_bytes = disk_read_bytes_.load(std::memory_order_relaxed);
  counts.decoded_bytes = decoded_bytes_.load(std::memory_order_relaxed);
  counts.rays_traced_count = rays_traced_count_.load(std::memory_order_relaxed);
  return counts;
}

void ThreadRecord::begin_hand(TreeletId treelet, uint64_t now, uint64_t visits, uint64_t decoded_bytes) {
  trace_->in_hand = treelet;
  trace_->hand_begin = now;
  trace_->visits_before = visits;
  trace_->decoded_before = decoded_bytes;
}

void ThreadRecord::end_hand(uint64_t now, uint64_t bytes, uint64_t visits, uint64_t decoded_bytes) {
  if (trace_->in_hand == kNoIndex) return;
  trace_->row.add(trace_->in_hand, trace_->hand_begin, now,
                  {visits - trace_->visits_before, bytes, decoded_bytes - trace_->decoded_before});
  trace_->in_hand = kNoIndex;
}

void ThreadRecord::note_wait(TreeletId treelet, uint64_t begin, uint64_t end, uint64_t loaded_bytes) {
  const char* name = treelet == kNoIndex ? "wait for texture" : "wait for page";
  if (trace_->in_hand != kNoIndex) {
    trace_->row.add_inside(name, treelet, std::max(begin, trace_->hand_begin), end, {0, 0, loaded_bytes});
  } else {
    trace_->row.add(treelet, begin, end, {0, 0, loaded_bytes});
  }
}

void ThreadRecord::finish(PhaseClock& clock, uint64_t now) {
  clock.settle(now);
  if (!trace_) return;
  trace_->show_phases(clock, now);
  trace_->row.flush();
  trace_->buffer.flush();
}

}  // namespace shoal
