// Where the threads of a render wait while one of them looks at all that they have done (engine/checkpoint). Called by
// engine/render_*, engine/checkpoint.
//
// Properties and assumptions
//   members    a thread is one from when it may touch paths and film until it is done with that. It passes a **safe
//              point** often (after each step of its rays): there every path under way is either in the film or as it was
//              before the rays that it has out, so that what is unfinished can be told from the path states alone.
//   alone()    waits until every other member stands at a safe point or has left; who would join waits as well.
//   deadlock   none: a member at a safe point holds no lock, and no more pages than the cache was made for
//              (io/page_cache.h), so the others reach theirs.
//   cost       at a safe point one relaxed load.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <vector>

#include "engine/path_state.h"

namespace shoal {

/// A sample that was begun and is not in the film, as checkpoints store it.
struct UnfinishedSample {
  uint32_t pixel = 0;
  uint32_t sample = 0;
  uint32_t seeks = 0;  ///< PathState::seeks of the path when it begins again
};
static_assert(sizeof(UnfinishedSample) == 12);

using VisitUnfinished = std::function<void(const UnfinishedSample&)>;
/// Visits the path's sample while it is under way.
inline void visit_unfinished(const PathState& path, const VisitUnfinished& visit) {
  if (path.under_way != 0) visit({path.pixel, path.sample, path.seeks});
}

/// Something that holds paths under way, or samples that are taken and not begun.
class UnfinishedPaths {
 public:
  virtual void each_unfinished(const VisitUnfinished& visit) const = 0;

 protected:
  ~UnfinishedPaths() = default;
};

class PauseGate {
 public:
  PauseGate() = default;
  PauseGate(const PauseGate&) = delete;
  PauseGate& operator=(const PauseGate&) = delete;

  /// While it lives, `paths` are asked for what is unfinished. Requires: made and let go by a member, or while there is
  /// none.
  class Source {
   public:
    Source(PauseGate& gate, const UnfinishedPaths& paths) : gate_(gate), paths_(paths) {
      const std::lock_guard guard(gate_.mutex_);
      gate_.sources_.push_back(&paths);
    }
    ~Source() {
      const std::lock_guard guard(gate_.mutex_);
      std::erase(gate_.sources_, &paths_);
    }
    Source(const Source&) = delete;
    Source& operator=(const Source&) = delete;

   private:
    PauseGate& gate_;
    const UnfinishedPaths& paths_;
  };

  /// While it lives, this thread is a member.
  class Member {
   public:
    explicit Member(PauseGate& gate) : gate_(gate) {
      std::unique_lock lock(gate_.mutex_);
      gate_.changed_.wait(lock, [this] { return !gate_.paused(); });
      ++gate_.members_;
    }
    ~Member() {
      const std::lock_guard guard(gate_.mutex_);
      gate_.spoiled_ = gate_.spoiled_ || std::uncaught_exceptions() > exceptions_;
      --gate_.members_;
      gate_.changed_.notify_all();
    }
    Member(const Member&) = delete;
    Member& operator=(const Member&) = delete;

   private:
    PauseGate& gate_;
    const int exceptions_ = std::uncaught_exceptions();
  };

  bool paused() const { return paused_.load(std::memory_order_relaxed); }

  /// A safe point of a member: waits while another is alone.
  void wait() {
    std::unique_lock lock(mutex_);
    wait(lock);
  }

  /// Runs `work` while all other members wait. Does nothing but wait when another is alone already, and nothing once a member
  /// has left by an exception: what it had begun is known to nobody. Requires: the caller is a member at a safe point.
  void alone(const std::function<void()>& work) {
    std::unique_lock lock(mutex_);
    if (paused()) return wait(lock);
    const Ending ending{*this, lock};
    paused_ = true;
    changed_.wait(lock, [this] { return waiting_ + 1 == members_; });
    if (spoiled_) return;
    lock.unlock();
    work();
  }

  /// Requires: called in alone().
  void each_unfinished(const VisitUnfinished& visit) const {
    for (const UnfinishedPaths* source : sources_) source->each_unfinished(visit);
  }

 private:
  /// Lets the others go, whatever ended the work.
  struct Ending {
    PauseGate& gate;
    std::unique_lock<std::mutex>& lock;
    ~Ending() {
      if (!lock.owns_lock()) lock.lock();
      gate.paused_ = false;
      gate.changed_.notify_all();
    }
  };

  void wait(std::unique_lock<std::mutex>& lock) {
    if (!paused()) return;
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !paused(); });
    --waiting_;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> paused_{false};
  uint32_t members_ = 0, waiting_ = 0;
  bool spoiled_ = false;  ///< a member left by an exception
  std::vector<const UnfinishedPaths*> sources_;
};

}  // namespace shoal
