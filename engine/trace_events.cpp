#include "engine/trace_events.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace shoal {
namespace {

/// An allowance is for so long: long enough to say how dense the events are, short enough for its end to be near.
constexpr double kWindowSeconds = 0.2;
/// Shorter pieces never stand alone: chosen; a screen shows no difference.
constexpr double kLeastSeconds = 5e-6;
constexpr size_t kLongestEventBytes = 512;
/// A begin and a length, each cut by less than one.
constexpr uint64_t kGapNanoseconds = 2;

}  // namespace

Result<std::unique_ptr<TraceFile>> TraceFile::create(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(fs, path));
  std::unique_ptr<TraceFile> trace(new TraceFile(std::move(file)));
  trace->append("{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n");
  return trace;
}

void TraceFile::append(std::string_view events) {
  const std::lock_guard guard(mutex_);
  if (status_.ok() && !events.empty()) status_ = file_.append(std::as_bytes(std::span(events)));
}

Status TraceFile::finish() {
  append("{\"name\":\"process_name\",\"ph\":\"M\",\"pid\":1,\"args\":{\"name\":\"shoal\"}}\n]}\n");
  SHOAL_RETURN_IF_ERROR(status_);
  return file_.commit();
}

TraceBuffer::TraceBuffer(TraceFile& file, const TraceClock& clock) : file_(file), clock_(clock) {
  text_.reserve(kTraceBufferBytes);
}

void TraceBuffer::name_row(uint32_t row, std::string_view name) {
  fmt::format_to(std::back_inserter(text_),
                 "{{\"name\":\"thread_name\",\"ph\":\"M\",\"pid\":1,\"tid\":{0},\"args\":{{\"name\":\"{1}\"}}}},\n"
                 "{{\"name\":\"thread_sort_index\",\"ph\":\"M\",\"pid\":1,\"tid\":{0},\"args\":{{\"sort_index\":{0}}}}},\n",
                 row, name);
  added();
}

void TraceBuffer::complete(uint32_t row, std::string_view name, uint64_t begin, uint64_t end, std::string_view args) {
  // Readers take these numbers for doubles, some cut them to nanoseconds one by one: an event that touches the next would
  // reach into it, and the next be drawn as a part of it. So each ends a little earlier.
  const auto from = static_cast<uint64_t>(clock_.at(begin) * 1000);
  const uint64_t to = std::max(from + kGapNanoseconds, static_cast<uint64_t>(clock_.at(end) * 1000)) - kGapNanoseconds;
  fmt::format_to(std::back_inserter(text_),
                 "{{\"name\":\"{}\",\"ph\":\"X\",\"pid\":1,\"tid\":{},\"ts\":{}.{:03},\"dur\":{}.{:03}", name, row,
                 from / 1000, from % 1000, (to - from) / 1000, (to - from) % 1000);
  if (!args.empty()) fmt::format_to(std::back_inserter(text_), ",\"args\":{{{}}}", args);
  text_ += "},\n";
  added();
}

void TraceBuffer::counter(std::string_view name, uint64_t at, std::string_view args) {
  fmt::format_to(std::back_inserter(text_), "{{\"name\":\"{}\",\"ph\":\"C\",\"pid\":1,\"ts\":{:.3f},\"args\":{{{}}}}},\n", name,
                 clock_.at(at), args);
  added();
}

void TraceBuffer::added() {
  if (text_.size() + kLongestEventBytes > kTraceBufferBytes) flush();
}

void TraceBuffer::flush() {
  file_.append(text_);
  text_.clear();
}

TraceBudget::TraceBudget(const TraceClock& clock, double events_a_second)
    : window_ticks_(clock.ticks_of(kWindowSeconds)),
      floor_ticks_(clock.ticks_of(kLeastSeconds)),
      least_ticks_(floor_ticks_),
      allowance_(std::max(2u, static_cast<uint32_t>(events_a_second * kWindowSeconds))) {}

void TraceBudget::roll(uint64_t now) {
  if (now < window_end_) return;
  if (used_ >= allowance_) {
    least_ticks_ *= 2;
  } else if (used_ < allowance_ / 4) {
    least_ticks_ = std::max(least_ticks_ / 2, floor_ticks_);
  }
  used_ = 0;
  window_end_ = now + window_ticks_;
}

bool TraceBudget::grants(uint64_t ticks, uint64_t end) {
  roll(end);
  if (ticks < least_ticks_ || used_ >= allowance_) return false;
  ++used_;
  return true;
}

TraceRow::TraceRow(TraceBuffer& buffer, TraceBudget& budget, uint32_t row, const char* one, const char* many,
                   double longest_seconds)
    : buffer_(buffer),
      budget_(budget),
      row_(row),
      one_(one),
      many_(many),
      longest_ticks_(buffer.clock().ticks_of(longest_seconds)) {}

void TraceRow::add(TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work) {
  if (budget_.grants(end - begin, end)) {
    flush();
    write(one_, treelet, begin, end, work);
    return;
  }
  if (merged_count_ > 0 && end - merged_begin_ > longest_ticks_) flush();
  if (merged_count_++ == 0) merged_begin_ = begin, merged_treelet_ = treelet;
  merged_end_ = end;
  merged_.rays += work.rays;
  merged_.bytes += work.bytes;
  merged_.loaded_bytes += work.loaded_bytes;
}

void TraceRow::add_inside(const char* name, TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work) {
  if (budget_.grants(end - begin, end)) write(name, treelet, begin, end, work);
}

void TraceRow::flush() {
  if (merged_count_ == 0) return;
  if (merged_count_ == 1) {
    write(one_, merged_treelet_, merged_begin_, merged_end_, merged_);
  } else {
    const std::string args = fmt::format("\"count\":{},\"rays\":{},\"bytes\":{},\"loaded_bytes\":{}", merged_count_,
                                         merged_.rays, merged_.bytes, merged_.loaded_bytes);
    buffer_.complete(row_, many_, merged_begin_, merged_end_, args);
  }
  budget_.count();
  merged_count_ = 0;
  merged_ = {};
}

void TraceRow::write(const char* name, TreeletId treelet, uint64_t begin, uint64_t end, const TraceWork& work) {
  std::string args;
  if (treelet != kNoIndex) args = fmt::format("\"treelet\":{},", treelet);
  args += fmt::format("\"rays\":{},\"bytes\":{},\"loaded_bytes\":{}", work.rays, work.bytes, work.loaded_bytes);
  buffer_.complete(row_, name, begin, end, args);
}

}  // namespace shoal
