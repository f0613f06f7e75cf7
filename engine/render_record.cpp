#include "engine/render_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "engine/clock.h"
#include "engine/scene.h"

namespace shoal {
namespace {

/// To know how long a tick is: a thousandth of this is the clocks' own error.
constexpr double kCalibrationSeconds = 2e-3;
/// Counters of a trace; without one only the timeline says how often.
constexpr double kTracedSampleSeconds = 0.02, kMostSampleSeconds = 3600;
constexpr uint32_t kFirstReadRow = 1u << 16;
constexpr double kReadsASecond = 800, kMergedReadSeconds = 0.02;

double in_mib(uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

}  // namespace

/// Treelets that are read ahead. Each read takes the first row that is free until it is noticed to be there.
struct RenderRecord::Reads {
  struct UnderWay {
    TreeletId treelet = kNoIndex;
    uint64_t begin = 0;
  };
  struct Shown {
    Shown(TraceFile& file, const TraceClock& clock) : buffer(file, clock), budget(clock, kReadsASecond) {}
    TraceBuffer buffer;
    TraceBudget budget;
    std::vector<TraceRow> rows;
  };

  Reads(uint32_t treelets_count, const TraceClock& clock, TraceFile* trace, unsigned read_depth) : heat(treelets_count) {
    if (trace == nullptr) return;
    shown.emplace(*trace, clock);
    under_way.resize(read_depth);
    shown->rows.reserve(read_depth);  // so that they are not asked for while rendering
  }

  TreeletHeat heat;
  std::vector<UnderWay> under_way;
  std::optional<Shown> shown;  ///< with a trace
};

RenderRecord::RenderRecord() : made_ticks_(now_ticks()), made_seconds_(now_seconds()) {}

RenderRecord::~RenderRecord() = default;

Status RenderRecord::open_trace(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(trace_, TraceFile::create(fs, path));
  return {};
}

uint64_t RenderRecord::bytes(unsigned threads, unsigned read_depth) {
  constexpr uint64_t kHeatBytes = kHeatCells * sizeof(HeatCell), kThreadStackBytes = 64 * 1024;
  return threads * (kHeatBytes + sizeof(ThreadRecord) + kTraceBufferBytes) + 2 * (kHeatBytes + kTraceBufferBytes) +
         read_depth * (sizeof(TraceRow) + sizeof(Reads::UnderWay)) + 2 * RenderTimeline::kCapacity * sizeof(TimelineSample) +
         kThreadStackBytes;
}

Status RenderRecord::begin(const Scene& scene, std::span<const TreeletId> page_treelets, PageCache& cache,
                           unsigned threads, unsigned read_depth, uint64_t start_ticks, double start_seconds) {
  double seconds = now_seconds();
  while (seconds - made_seconds_ < kCalibrationSeconds) seconds = now_seconds();
  const uint64_t ticks = std::max<uint64_t>(now_ticks() - made_ticks_, 1);
  clock_ = {start_ticks, (seconds - made_seconds_) * 1e6 / static_cast<double>(ticks)};
  start_seconds_ = start_seconds;
  scene_ = &scene;
  page_treelets_ = page_treelets;
  cache_ = &cache;
  course_ = RenderCourse();
  has_queues_ = false;
  const auto treelets = static_cast<uint32_t>(scene.treelets.size());
  threads_.clear();
  for (unsigned i = 0; i < threads; ++i) {
    threads_.push_back(std::make_unique<ThreadRecord>(treelets, page_treelets, clock_, trace_.get(), i, threads));
  }
  reads_ = std::make_unique<Reads>(treelets, clock_, trace_.get(), read_depth);
  if (trace_) samples_buffer_ = std::make_unique<TraceBuffer>(*trace_, clock_);
  return timeline_.start([this] { return look(); }, trace_ ? kTracedSampleSeconds : kMostSampleSeconds);
}

void RenderRecord::end(std::span<PhaseClock> clocks) {
  if (cache_ == nullptr) return;
  watch({});
  std::vector<PageId> pages;  // that came when nobody looked any more
  cache_->take_loaded(pages);
  for (const PageId page : pages) read_finished(page);
  timeline_.stop();
  course_.heat = std::move(reads_->heat);
  for (size_t i = 0; i < threads_.size(); ++i) {
    threads_[i]->finish(clocks[i], clocks[i].settled_at());  // as the render's own times, whatever was waited for since
    course_.heat.add(threads_[i]->heat());
  }
  course_.timeline = timeline_.timeline().samples();
  course_.interval_seconds = timeline_.timeline().interval_seconds();
  course_.has_queues = has_queues_;
  if (reads_->shown) {
    for (TraceRow& row : reads_->shown->rows) row.flush();
  }
  threads_.clear();
  reads_.reset();
  samples_buffer_.reset();
  cache_ = nullptr;
}

void RenderRecord::watch(std::function<QueueOccupancy()> queues) {
  const std::lock_guard guard(queues_mutex_);
  has_queues_ = has_queues_ || queues;
  queues_ = std::move(queues);
}

TimelineSample RenderRecord::look() {
  TimelineSample sample;
  const CacheCounters background = cache_->background_counters();
  sample.disk_read_bytes = background.disk_read_bytes;
  sample.decoded_bytes = background.decoded_bytes;
  uint64_t started = 0;
  for (const auto& thread : threads_) {
    const LiveCounts live = thread->live();
    sample.disk_read_bytes += live.disk_read_bytes;
    sample.decoded_bytes += live.decoded_bytes;
    sample.rays_traced_count += live.rays_traced_count;
    sample.samples_done_count += live.samples_done_count;
    started += live.samples_started_count;
  }
  // A path may end on another thread than it began on, which may not have told of it yet.
  sample.paths_in_flight_count = started - std::min(started, sample.samples_done_count);
  {
    const std::lock_guard guard(queues_mutex_);
    if (queues_) {
      const QueueOccupancy queues = queues_();
      sample.rays_waiting_count = queues.rays_waiting_count;
      sample.treelets_waiting_count = queues.treelets_waiting_count;
    }
  }
  sample.cache_bytes = cache_->resident_bytes();
  sample.seconds = now_seconds() - start_seconds_;
  if (samples_buffer_) trace_sample(sample);
  return sample;
}

void RenderRecord::trace_sample(const TimelineSample& sample) {
  const uint64_t now = now_ticks();
  const auto show = [&](const char* name, const char* unit, auto value) {
    samples_buffer_->counter(name, now, fmt::format("\"{}\":{}", unit, value));
  };
  show("rays waiting", "rays", sample.rays_waiting_count);
  show("treelets with rays", "treelets", sample.treelets_waiting_count);
  show("paths in flight", "paths", sample.paths_in_flight_count);
  show("read from disk", "MiB", in_mib(sample.disk_read_bytes));
  show("page cache", "MiB", in_mib(sample.cache_bytes));
}

void RenderRecord::read_started(TreeletId treelet) {
  if (!reads_->shown) return;
  for (Reads::UnderWay& read : reads_->under_way) {
    if (read.treelet != kNoIndex) continue;
    read = {treelet, now_ticks()};
    return;
  }
}

void RenderRecord::read_finished(PageId page) {
  const TreeletId treelet = page_treelets_[page];
  if (treelet == kNoIndex) return;
  const uint64_t bytes = scene_->file->record(page).raw_bytes;
  HeatCell& cell = reads_->heat.of(treelet);
  cell.loads_count += page == scene_->treelets[treelet].geometry ? 1 : 0;
  cell.load_bytes += bytes;
  if (!reads_->shown) return;
  std::vector<TraceRow>& rows = reads_->shown->rows;
  for (size_t i = 0; i < reads_->under_way.size(); ++i) {
    Reads::UnderWay& read = reads_->under_way[i];
    if (read.treelet != treelet) continue;
    while (rows.size() <= i) {
      const auto row = static_cast<uint32_t>(kFirstReadRow + rows.size());
      reads_->shown->buffer.name_row(row, fmt::format("reads ahead {}", rows.size() + 1));
      rows.emplace_back(reads_->shown->buffer, reads_->shown->budget, row, "read", "reads", kMergedReadSeconds);
    }
    rows[i].add(treelet, read.begin, now_ticks(), {0, bytes, bytes});
    read.treelet = kNoIndex;
    return;
  }
}

Status RenderRecord::finish_trace() {
  if (!trace_) return {};
  const std::unique_ptr<TraceFile> trace = std::move(trace_);
  return trace->finish();
}

}  // namespace shoal
