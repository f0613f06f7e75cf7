#include "engine/render_timeline.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <new>
#include <system_error>

namespace shoal {
namespace {

/// Looking at every queue takes a millisecond in the largest scenes.
constexpr double kLookShare = 0.02;
/// A thread that is woken a little early still brings the sample that is due.
constexpr double kEarlyShare = 0.1;

/// Of this thread: what a look costs, and not how long it waited for its turn on a busy machine.
double thread_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

void RenderTimeline::add(const TimelineSample& sample) {
  if (!samples_.empty() && sample.seconds - samples_.back().seconds < (1 - kEarlyShare) * interval_seconds_) return;
  keep(sample);
}

void RenderTimeline::add_last(const TimelineSample& sample) { keep(sample); }

void RenderTimeline::keep(const TimelineSample& sample) {
  if (samples_.size() == kCapacity) {
    for (size_t i = 0; 2 * i < samples_.size(); ++i) samples_[i] = samples_[2 * i];
    samples_.resize((samples_.size() + 1) / 2);
    interval_seconds_ *= 2;
  }
  samples_.push_back(sample);
}

Status TimelineThread::start(std::function<TimelineSample()> look, double most_seconds) {
  look_ = std::move(look);
  most_seconds_ = most_seconds;
  stopped_ = false;
  timeline_ = RenderTimeline();
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error&) {
    return Error{ErrorCode::kMemoryCap, "no thread to record the render with: the system gives no more"};
  }
  return {};
}

void TimelineThread::stop() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard guard(mutex_);
    stopped_ = true;
  }
  wake_.notify_all();
  thread_.join();
  timeline_.add_last(look_());
}

void TimelineThread::run() {
  std::unique_lock lock(mutex_);
  while (!stopped_) {
    lock.unlock();
    const double start = thread_cpu_seconds();
    try {
      timeline_.add(look_());
    } catch (const std::bad_alloc&) {  // a look is missing then; the render is told by whoever needs memory
    }
    const double least = (thread_cpu_seconds() - start) / kLookShare;
    lock.lock();
    const double seconds = std::max(least, std::min(timeline_.interval_seconds(), most_seconds_));
    wake_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stopped_; });
  }
}

}  // namespace shoal
