#include "engine/order_runner.h"

#include <fmt/format.h>

#include "engine/aov_film.h"
#include "engine/clock.h"
#include "engine/render_record.h"

namespace shoal {
namespace {

/// What a texture tile counts for when pages are evicted, in rays: nothing waits for a tile by name, but dropping tiles
/// first read 1.7 times the bytes and 8 times the pages of dropping treelets with fewer waiting rays before them
/// (demo scene, 480 x 270, 2 spp, cap 80M; 1024 instead of 64 made no difference).
constexpr uint64_t kTextureTileWork = 64;
/// What it counts for besides where usual demand counts: a tile is a sixteenth of a treelet, and who misses it waits for
/// the disk. With nothing, treelets that were crowded before kept tiles out: 116,567 tiles read instead of 747, three
/// times the time (demo scene, 480 x 270, 2 spp, cap 80M).
constexpr uint64_t kTextureTileDemand = 1u << 14;

}  // namespace

Status check_policies(const ExecutionOptions& execution) {
  if (make_drain_policy(execution.policy, execution.policy_options) == nullptr) {
    return Error{ErrorCode::kUsage, fmt::format("unknown policy '{}': expected one of {}", execution.policy,
                                                fmt::join(drain_policy_names(), ", "))};
  }
  if (make_eviction_policy(execution.paging.eviction) == nullptr) {
    return Error{ErrorCode::kUsage, fmt::format("unknown eviction '{}': expected one of {}", execution.paging.eviction,
                                                fmt::join(eviction_policy_names(), ", "))};
  }
  return {};
}

OrderRunner::OrderRunner(const Scene& scene, const ExecutionOptions& execution, const MemoryPlan& plan,
                         uint64_t samples)
    : scene_(scene),
      execution_(execution),
      plan_(plan),
      chosen_(choose_before_trials(execution.order, plan, samples).chosen),
      page_treelets_(treelet_of_pages(scene)),
      batches_(scene.treelets.size()) {}

WaitingWork OrderRunner::waiting_work() const {
  if (chosen_.order != Order::kQueued) return {};
  return [this](PageId page) {
    const TreeletId treelet = page_treelets_[page];
    if (treelet == kNoIndex) return PageDemand(kTextureTileWork, kTextureTileDemand);
    return PageDemand(queued_ != nullptr ? queued_->waiting(treelet) : 0, batches_.of(treelet));
  };
}

void OrderRunner::run(RenderContext& context) {
  if (!tried_) choose(context);
  context.end_sample = context.samples.count();
  run_order(context, chosen_.order);
}

void OrderRunner::choose(RenderContext& context) {
  const FirstChoice first =
      choose_before_trials(execution_.order, plan_, context.samples.count() - context.samples_done);
  chosen_ = first.chosen;
  if (first.to_be_tried) {
    if (context.all_samples_done() == context.samples_restored) try_order(context, chosen_.order);
    std::vector<OrderTrial> trials;
    for (const Order order : kTriedOrders) trials.push_back(try_order(context, order));
    chosen_ = choose_by_trials(trials);
    tried_ = true;
  }
  if (execution_.order == Order::kAuto && context.hooks.chosen && (tried_ || !told_)) context.hooks.chosen(chosen_);
  told_ = true;
}

void OrderRunner::release() {
  queued_.reset();
  sorted_.reset();
}

OrderTrial OrderRunner::try_order(RenderContext& context, Order order) {
  const auto tests = [&] {
    const RayCounters rays = context.counters.total();
    return rays.rays_traced_count + rays.triangle_tests_count;
  };
  OrderTrial trial{order};
  const uint64_t tests_before = tests();
  const double start = process_cpu_seconds();
  context.end_sample += trial_samples(plan_);
  run_order(context, order);
  trial.seconds = process_cpu_seconds() - start;
  trial.tests = tests() - tests_before;
  return trial;
}

void OrderRunner::run_order(RenderContext& context, Order order) {
  if (context.ended) return;
  if (order != Order::kQueued) queued_.reset();
  if (order != Order::kSorted) sorted_.reset();
  if (order == Order::kQueued) {
    run_queued(context);
  } else if (order == Order::kSorted) {
    if (!sorted_) {
      sorted_ = std::make_unique<SortedPaths>(scene_.top_tree.bounds(), plan_.paths_in_flight, context.threads);
    }
    render_sorted(context, *sorted_);
  } else {
    run_without_waiting(context, order);
  }
}

void OrderRunner::run_without_waiting(RenderContext& context, Order order) {
  context.packet_rays = execution_.packet_rays;
  switch (order) {
    case Order::kHybrid: return render_hybrid(context);
    case Order::kPacket: return render_packet(context);
    case Order::kPacketReorder: return render_packet_reorder(context);
    case Order::kStream: return render_stream(context);
    case Order::kDepthFirstWhileWhile: return render_depth_first(context, InnerLoop::kWhileWhile);
    case Order::kDepthFirstIfIf: return render_depth_first(context, InnerLoop::kIfIf);
    default: return render_depth_first(context);
  }
}

void OrderRunner::run_queued(RenderContext& context) {
  const auto treelets = static_cast<uint32_t>(scene_.treelets.size());
  if (!queued_) queued_ = std::make_unique<QueuedPaths>(treelets, plan_.paths_in_flight, context.threads);
  const std::unique_ptr<DrainPolicy> policy =
      make_drain_policy(execution_.policy, scaled_policy(execution_.policy_options, execution_.paging, treelets,
                                                         plan_.paths_in_flight));
  AovFilm* const loads = context.aovs != nullptr && context.aovs->set().has(Aov::kBytes) ? context.aovs : nullptr;
  TreeletScheduler scheduler(scene_, *queued_, context.cache, *policy, batches_, page_treelets_, loads,
                             context.list == nullptr, context.record);
  if (context.record != nullptr) {
    context.record->watch([this, treelets] {
      QueueOccupancy queues;
      for (TreeletId id = 0; id < treelets; ++id) {
        const uint32_t waiting = queued_->waiting(id);
        queues.rays_waiting_count += waiting;
        queues.treelets_waiting_count += waiting > 0 ? 1 : 0;
      }
      return queues;
    });
  }
  render_queued(context, *queued_, scheduler, batches_);
  if (context.record != nullptr) context.record->watch({});
  context.cache.finish_loads();  // which ask what waits
}

}  // namespace shoal
