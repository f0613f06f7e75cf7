// A trace of a render in Chrome's Trace Event Format, for Perfetto (ui.perfetto.dev) and chrome://tracing: pieces of work on
// rows, and counters, in microseconds since the render began. Called by engine/render_record. The format is Google's
// document "Trace Event Format"; used of it: complete events (X), counters (C), names of rows (M).
//
// Properties and assumptions
//   memory     a buffer of kTraceBufferBytes for each writer, whatever the render's length; nothing else grows.
//   size       bounded by the time: phases come in slices, short pieces of work are merged, and each row has an allowance
//              of events (TraceBudget), so that a minute takes less than 100 MB whatever the threads and the scene.
//   nesting    events of a row lie one after another or one inside another, never across.
//   threads    TraceFile: any number; all else one at a time.
//   failure    a file that cannot be written is noted, and said by finish(); the render goes on.
//   the end    finish() makes the file whole; without it nothing is left under its name.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "io/file.h"
#include "io/result.h"
#include "treelets/ray.h"

namespace shoal {

inline constexpr size_t kTraceBufferBytes = 32 * 1024;

/// From ticks (io/ticks.h) to the trace's microseconds.
struct TraceClock {
  uint64_t start_ticks = 0;
  double microseconds_a_tick = 0;

  double at(uint64_t ticks) const {
    return ticks <= start_ticks ? 0 : static_cast<double>(ticks - start_ticks) * microseconds_a_tick;
  }
  uint64_t ticks_of(double seconds) const { return static_cast<uint64_t>(seconds * 1e6 / microseconds_a_tick); }
};

class TraceFile {
 public:
  /// Fails with: kStorage.
  static Result<std::unique_ptr<TraceFile>> create(FileSystem& fs, const std::string& path);
  /// Whole events, each ending with a comma and a line break.
  void append(std::string_view events);
  /// Ends the list and gives the file its name. Once, when nobody writes any more. Fails with: kStorage, now or before.
  Status finish();

 private:
  explicit TraceFile(AtomicFile file) : file_(std::move(file)) {}
  std::mutex mutex_;
  AtomicFile file_;
  Status status_;
};

/// Gathers events for a file.
class TraceBuffer {
 public:
  TraceBuffer(TraceFile& file, const TraceClock& clock);
  ~TraceBuffer() { flush(); }
  TraceBuffer(const TraceBuffer&) = delete;
  TraceBuffer& operator=(const TraceBuffer&) = delete;

  /// Names a row; those with smaller numbers stand above.
  void name_row(uint32_t row, std::string_view name);
  /// `args`: the inside of a JSON object, or empty. Names and args are ours: nothing is escaped.
  void complete(uint32_t row, std::string_view name, uint64_t begin, uint64_t end, std::string_view args = {});
  void counter(std::string_view name, uint64_t at, std::string_view args);
  void flush();
  const TraceClock& clock() const { return clock_; }

 private:
  void added();
  TraceFile& file_;
  const TraceClock& clock_;
  std::string text_;
};

/// How many events a row, or several together, may have, and from which length on they stand alone.
class TraceBudget {
 public:
  TraceBudget(const TraceClock& clock, double events_a_second);
  /// Whether a piece of work that ends at `end` stands alone; counts it then.
  bool grants(uint64_t ticks, uint64_t end);
  void count() { ++used_; }

 private:
  void roll(uint64_t now);
  uint64_t window_ticks_, floor_ticks_, least_ticks_;
  uint64_t window_end_ = 0;
  uint32_t allowance_, used_ = 0;
};

/// What was done for a treelet, or for several that are merged.
struct TraceWork {
  uint64_t rays = 0, bytes = 0, loaded_bytes = 0;
};

/// A row of pieces of work for treelets.
class TraceRow {
 public:
  /// Merged pieces span `longest_seconds` at most, or one piece. `one`: the name of a piece, `many`: of merged ones.
  TraceRow(TraceBuffer& buffer, TraceBudget& budget, uint32_t row, const char* one, const char* many,
           double longest_seconds);

  /// Pieces come in the order of their ends.
  void add(TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work);
  /// A piece inside of one that is not added yet, which shows alone or not at all.
  void add_inside(const char* name, TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work);
  /// What is merged until now.
  void flush();

 private:
  void write(const char* name, TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work);
  TraceBuffer& buffer_;
  TraceBudget& budget_;
  uint32_t row_;
  const char *one_, *many_;
  uint64_t longest_ticks_;
  uint64_t merged_count_ = 0, merged_begin_ = 0, merged_end_ = 0;
  TreeletId merged_treelet_ = kNoIndex;  ///< of a single one
  TraceWork merged_;
};

}  // namespace shoal
