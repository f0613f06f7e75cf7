// Runs orders over the samples of one render, pass by pass, and chooses among them where that was asked for: what one
// needs is made before it begins and gone before another does, so that of the plan's memory for paths and rays only one
// uses it. Called by engine/render.
#pragma once

#include <memory>
#include <vector>

#include "engine/choose_order.h"
#include "engine/queued_paths.h"
#include "engine/render_worker.h"
#include "engine/sorted_paths.h"
#include "engine/treelet_scheduler.h"

namespace shoal {

/// Names of policies that there are. Fails with: kUsage.
Status check_policies(const ExecutionOptions& execution);

class OrderRunner {
 public:
  /// What is passed outlives it. `samples`: of the first pass.
  OrderRunner(const Scene& scene, const ExecutionOptions& execution, const MemoryPlan& plan, uint64_t samples);

  /// What waits for each page, for eviction and reads ahead; empty where nothing ever does. To be given to the page
  /// cache, which must not outlive this.
  WaitingWork waiting_work() const;

  /// Renders the samples of a pass, until they are in the film or context.ended is set.
  void run(RenderContext& context);
  /// The order that rendered most samples of the last pass, and why.
  const ChosenOrder& chosen() const { return chosen_; }
  /// As treelet_of_pages() says.
  std::span<const TreeletId> page_treelets() const { return page_treelets_; }
  /// Gives back what the orders hold from pass to pass.
  void release();

 private:
  /// Before the samples of a pass are rendered; by trials in the first that is long enough.
  void choose(RenderContext& context);
  void run_order(RenderContext& context, Order order);
  OrderTrial try_order(RenderContext& context, Order order);
  void run_queued(RenderContext& context);
  void run_without_waiting(RenderContext& context, Order order);

  const Scene& scene_;
  const ExecutionOptions& execution_;
  const MemoryPlan& plan_;
  ChosenOrder chosen_;
  bool tried_ = false;  ///< the choice stands
  bool told_ = false;   ///< hooks.chosen was called
  std::vector<TreeletId> page_treelets_;
  UsualBatches batches_;
  std::unique_ptr<QueuedPaths> queued_;  ///< from when the queued order runs until another does
  std::unique_ptr<SortedPaths> sorted_;  ///< likewise
};

}  // namespace shoal
