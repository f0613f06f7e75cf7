// What the threads of one render touch of memory, through a model of their caches: a run of its own beside those
// that are timed (`shoal compare`), with the same options, the same kernels and the same picture. Handed to
// render() in ExecutionOptions::touches.
//
// All rays of the picture are told, in the order in which their threads trace them: sampling rays or tiles would
// let rays meet that do not meet, and part those that do. Where that is too slow one in so many sets of every cache
// is modelled, with all that falls into them (engine/cache_model.h).
//
// Told are: the top tree; headers, nodes and leaves of treelets; rays in hand, with contexts, jobs and stacks; rays
// in queues, outboxes and waves, keys while they are sorted; path states; pages that the thread decodes itself. Not
// told: what shading reads beside path states (attributes, textures, lights, tables), the film, locks and tables of
// queues, pages read ahead by other threads.
//
// Properties and assumptions
//   caches     every thread has all levels but the last for itself; the last, with more than one level, is shared
//   by
//              all, which take turns at it some 512 lines at a time. Starts cold; written lines go back in the end.
//   threads    log() by any number, each with its own log. report() when the render has ended.
//   memory     8 bytes a line of the caches, over one_in.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "engine/cache_model.h"
#include "treelets/touch_log.h"

namespace shoal {

/// What a modelled run leaves.
struct TouchReport {
  CacheModel::Options cache;
  std::vector<LevelCounts> levels;  ///< of all threads
  LineCounts memory;                ///< lines between the last level and memory
  std::vector<LineCounts> by_kind;  ///< the same, by TouchKind
  uint64_t treelet_lines = 0;       ///< lines of headers, nodes and leaves read, each time anew; exact
  LaneUses lanes;
  uint32_t line_bytes = 64;
};

class TouchRecorder {
 public:
  /// Requires: options.check() is well. Without `prefetches`, what kernels ask for ahead of time is left out.
  explicit TouchRecorder(const CacheModel::Options& options, bool prefetches = true);
  ~TouchRecorder();
  TouchRecorder(const TouchRecorder&) = delete;
  TouchRecorder& operator=(const TouchRecorder&) = delete;

  /// Of the thread with this index, the same each time.
  TouchLog& log(unsigned thread);
  /// Empties the caches. Requires: no thread logs any more.
  TouchReport report();
  /// Counts so far, without what is dirty in the caches still. Requires: likewise. Cheap.
  std::vector<LevelCounts> levels_so_far();

 private:
  class Thread;

  CacheModel::Options options_;
  bool prefetches_;
  SetSample sample_;
  std::unique_ptr<SharedCache> last_;  ///< of two levels or more
  std::mutex mutex_;                   ///< guards threads_
  std::vector<std::unique_ptr<Thread>> threads_;
};

}  // namespace shoal
