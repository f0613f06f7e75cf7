// `shoal batch`: renders every scene of a plan in a process of its own, so many at once as the budget is shared by,
// remembers what is done, goes on when one fails, and says how it stands. Called by bins/command_batch.
// Whatever ends it, and at any instant: what lies under the name of an output is whole, a record says "done" only of
// outputs that are in place, and its renders end with it. Thread rule: one thread; the renders have their own.
// Cost: a look at each scene that is done, a hash of each that is not, little beside a render.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "engine/batch_plan.h"
#include "engine/batch_summary.h"
#include "io/result.h"

namespace shoal {

struct BatchHooks {
  std::function<void(const BatchEntry&)> started;  ///< may be empty, as the others
  /// Done, skipped or failed.
  std::function<void(const BatchEntry&, const BatchCounts&)> ended;
  std::function<void(const BatchCounts&, double seconds)> progress;  ///< a few times a second
  std::function<void(const std::string&)> warning;
  const std::atomic<bool>* stop = nullptr;  ///< ends the renders and then the batch when it becomes true
};

struct BatchResult {
  BatchCounts counts;
  bool stopped = false;
  bool unreadable = false;  ///< folders: scenes may have been missed
};

/// Fails with: kStorage (`out` cannot be written, another batch is at work there), kMemoryCap (nothing is left for a
/// render), kStopped.
Result<BatchResult> run_batch(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules,
                              const BatchPlan& plan, const BatchHooks& hooks);

/// A scene as it stands now, beside what is remembered of it.
struct SceneLook {
  bool done = false;             ///< its outputs are those of this scene, these options and this program
  bool content_changed = false;  ///< since it was rendered or tried
  bool as_before = false;        ///< nothing changed: what a render that was stopped has done is of this picture
  SceneRecord record;            ///< what is remembered of one that is done; else its key, content and options
};
/// Also for --dry-run. Fails with: kStorage, kStopped.
Result<SceneLook> look_at_scene(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules,
                                const BatchScene& scene, const std::atomic<bool>* stop);

/// The budget of all renders: what the batch itself takes is not theirs. Fails with: kMemoryCap.
Result<BatchShare> batch_budget(const BatchOptions& options);

}  // namespace shoal
