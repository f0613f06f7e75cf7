#include "engine/touch_recorder.h"

namespace shoal {

static_assert(kTouchKindCount <= CacheModel::kMaxKinds);

/// What one thread touches goes through its own caches.
class TouchRecorder::Thread final : public TouchSink {
 public:
  Thread(std::span<const CacheShape> levels, const SetSample& sample, SharedCache* last, bool prefetches)
      : model_(levels, sample, last), prefetches_(prefetches), log_(*this) {}

  void take(std::span<const Touch> touches) override {
    const uint64_t line = model_.line_bytes();
    for (const Touch& touch : touches) {
      const bool ahead = touch.action == TouchAction::kPrefetch;
      if (ahead && !prefetches_) continue;
      model_.touch(touch.address, touch.bytes, touch.action == TouchAction::kWrite,
                   static_cast<uint8_t>(touch.kind));
      const bool of_treelet = touch.kind == TouchKind::kNodes || touch.kind == TouchKind::kLeaves;
      if (!of_treelet || ahead) continue;
      treelet_lines_ += (touch.address + touch.bytes - 1) / line - touch.address / line + 1;
    }
  }

  TouchLog& log() { return log_; }
  CacheModel& model() { return model_; }
  uint64_t treelet_lines() const { return treelet_lines_; }

 private:
  CacheModel model_;
  bool prefetches_;
  uint64_t treelet_lines_ = 0;
  TouchLog log_;
};

TouchRecorder::TouchRecorder(const CacheModel::Options& options, bool prefetches)
    : options_(options), prefetches_(prefetches), sample_(SetSample::of(options.levels, options.one_in)) {
  if (options.levels.size() > 1) last_ = std::make_unique<SharedCache>(options.levels.back(), sample_);
}

TouchRecorder::~TouchRecorder() = default;

TouchLog& TouchRecorder::log(unsigned thread) {
  std::lock_guard guard(mutex_);
  if (thread >= threads_.size()) threads_.resize(thread + 1);
  if (threads_[thread] == nullptr) {
    const std::span<const CacheShape> levels(options_.levels);
    threads_[thread] = std::make_unique<Thread>(last_ ? levels.first(levels.size() - 1) : levels, sample_,
                                                last_.get(), prefetches_);
  }
  return threads_[thread]->log();
}

std::vector<LevelCounts> TouchRecorder::levels_so_far() {
  std::vector<LevelCounts> sums(options_.levels.size());
  for (const auto& thread : threads_) {
    if (thread == nullptr) continue;
    thread->log().flush();
    thread->model().hand_on();
    for (size_t i = 0; i < thread->model().level_count(); ++i) sums[i].add(thread->model().level(i));
  }
  if (last_) sums.back().add(last_->model().level(0));
  return sums;
}

TouchReport TouchRecorder::report() {
  TouchReport report;
  report.cache = options_;
  report.line_bytes = options_.levels[0].line_bytes;
  report.by_kind.resize(kTouchKindCount);
  const auto add_memory = [&](const CacheModel& model) {
    for (uint8_t kind = 0; kind < kTouchKindCount; ++kind) {
      const LineCounts lines = model.counts(kind);
      report.by_kind[kind].fills += lines.fills, report.by_kind[kind].write_backs += lines.write_backs;
      report.memory.fills += lines.fills, report.memory.write_backs += lines.write_backs;
    }
  };
  for (const auto& thread : threads_) {
    if (thread == nullptr) continue;
    thread->log().flush();
    thread->model().flush();
    add_memory(thread->model());
    report.treelet_lines += thread->treelet_lines();
    report.lanes.add(thread->log().lanes);
  }
  if (last_) {
    last_->model().flush();
    add_memory(last_->model());
  }
  report.levels = levels_so_far();
  return report;
}

}  // namespace shoal
