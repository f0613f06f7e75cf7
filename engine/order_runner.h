// Runs orders over the samples of one render, and chooses among them where that was asked for: what each needs is made
// before it begins and gone after it ended, so that of the plan's memory for paths and rays only one uses it. Called by
// engine/render.
#pragma once

#include <memory>
#include <vector>

#include "engine/choose_order.h"
#include "engine/queued_paths.h"
#include "engine/render_worker.h"
#include "engine/treelet_scheduler.h"

namespace shoal {

class OrderRunner {
 public:
  /// What is passed outlives it.
  OrderRunner(const Scene& scene, const ExecutionOptions& execution, const MemoryPlan& plan, uint64_t samples);

  /// What waits for each page, for eviction and reads ahead; empty where nothing ever does. To be given to the page
  /// cache, which must not outlive this.
  WaitingWork waiting_work() const;

  /// Renders all samples, until they are in the film or context.ended is set. Returns the order that rendered most of
  /// them and why.
  ChosenOrder run(RenderContext& context);

 private:
  void run_order(RenderContext& context, Order order);
  OrderTrial try_order(RenderContext& context, Order order);
  void run_queued(RenderContext& context);

  const Scene& scene_;
  const ExecutionOptions& execution_;
  const MemoryPlan& plan_;
  FirstChoice first_;
  std::vector<TreeletId> page_treelets_;
  UsualBatches batches_;
  std::unique_ptr<QueuedPaths> queued_;  ///< while the queued order runs, or may at once
};

}  // namespace shoal
