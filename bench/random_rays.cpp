#include "bench/random_rays.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <thread>

#include "engine/clock.h"
#include "engine/frame.h"
#include "engine/path_ray.h"
#include "engine/queued_paths.h"
#include "engine/render_worker.h"
#include "engine/run_on_threads.h"
#include "engine/surface_error.h"
#include "engine/treelet_scheduler.h"
#include "treelets/treelet_view.h"

namespace shoal::bench {
namespace {

struct RayStart {
  Vec3 origin, direction;
};

/// A ray from triangle `index` of a leaf; degenerate triangles give a ray straight up.
RayStart start_from(const LeafView& leaf, uint32_t index, std::mt19937_64& random) {
  std::uniform_real_distribution<float> uniform(0, 1);
  const Vec3 p0 = leaf.position(index, 0), p1 = leaf.position(index, 1), p2 = leaf.position(index, 2);
  float b1 = uniform(random), b2 = uniform(random);
  if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
  Vec3 normal = glm::cross(p1 - p0, p2 - p0);
  const float length = glm::length(normal);
  normal = length > 0 ? normal / length : Vec3(0, 1, 0);
  if (uniform(random) < 0.5f) normal = -normal;
  return {offset_point(point_on_triangle(p0, p1, p2, b1, b2), normal),
          Frame(normal).to_world(sample_cosine_hemisphere(uniform(random), uniform(random)))};
}

/// Reads every treelet once; `wanted` are sorted numbers of triangles, counted treelet by treelet.
Status collect_starts(const Scene& scene, std::span<const uint64_t> wanted, std::mt19937_64& random,
                      std::vector<RayStart>& starts) {
  std::vector<std::byte> page;
  uint64_t first = 0;  // triangle of the leaf
  size_t next = 0;
  for (TreeletId id = 0; id < scene.treelets.size() && next < wanted.size(); ++id) {
    const PageRecord& record = scene.file->record(scene.treelets[id].geometry);
    page.resize(record.raw_bytes + 64ull);
    const std::span<std::byte> bytes(page.data(), record.raw_bytes);
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(scene.file->read_page(record.id, bytes, &read_bytes));
    SHOAL_RETURN_IF_ERROR(check_page(scene, record, bytes));
    const TreeletView view(bytes);
    for (uint32_t offset = 0; offset < view.header->leaves_bytes;) {
      const LeafView leaf = view.leaf(offset / 4);
      for (; next < wanted.size() && wanted[next] < first + leaf.triangle_count; ++next) {
        starts.push_back(start_from(leaf, static_cast<uint32_t>(wanted[next] - first), random));
      }
      first += leaf.triangle_count;
      offset += leaf.bytes();
    }
  }
  return {};
}

Result<std::vector<RayStart>> make_starts(const Scene& scene, uint64_t count) {
  std::mt19937_64 random(1);
  std::vector<uint64_t> wanted(count);
  // Degenerate triangles are counted by the header but not stored: the last numbers may find none.
  std::uniform_int_distribution<uint64_t> any(0, scene.header.triangles_count - 1);
  for (uint64_t& index : wanted) index = any(random);
  std::sort(wanted.begin(), wanted.end());
  std::vector<RayStart> starts;
  starts.reserve(count);
  SHOAL_RETURN_IF_ERROR(collect_starts(scene, wanted, random, starts));
  std::shuffle(starts.begin(), starts.end(), random);
  return starts;
}

/// What the threads share.
struct RandomContext {
  const Scene& scene;
  std::span<const RayStart> starts;
  QueuedPaths& slots;  ///< a path a ray; its state is not used
  TreeletScheduler& scheduler;
  UsualBatches& batches;
  PageCache& cache;
  std::atomic<uint64_t> next{0}, done{0};
  std::atomic<bool> ended{false};
  std::mutex mutex{};
  Status error{};
  CacheCounters counters{};
  uint64_t visits = 0, drains = 0, hits = 0;
};

class RandomWorker {
 public:
  explicit RandomWorker(RandomContext& context) : context_(context) {}

  void run() {
    while (!context_.ended && context_.done < context_.starts.size()) {
      while (more_coming()) admit();
      const TreeletId treelet = context_.scheduler.choose(more_coming(), counters_);
      if (treelet != kNoIndex) {
        drain(treelet);
      } else if (context_.cache.loading_count() > 0) {
        context_.cache.wait_for_load(std::chrono::microseconds(1000));
      } else {
        std::this_thread::yield();
      }
    }
    const std::lock_guard guard(context_.mutex);
    context_.counters.add(counters_);
    context_.visits += visits_, context_.drains += drains_, context_.hits += hits_;
  }

 private:
  bool more_coming() const {
    return context_.slots.free_count() > 0 && context_.next < context_.starts.size() && !context_.ended;
  }

  void admit() {
    uint32_t slot = kNoIndex;
    const uint32_t taken = context_.slots.take_free(1024, &slot);
    const uint64_t first = context_.next.fetch_add(taken);
    for (uint64_t index = first; index < first + taken; ++index) {
      const uint32_t current = slot;
      slot = context_.slots.state(current).next;
      if (index >= context_.starts.size()) {
        context_.slots.give_back(current);
        continue;
      }
      Ray ray;
      ray.origin = context_.starts[index].origin;
      ray.direction = context_.starts[index].direction;
      ray.t = kRayInfinity;
      ray.path = current;
      ray.alpha_seed = static_cast<uint32_t>(index);
      route(ray);
    }
  }

  void drain(TreeletId treelet) {
    context_.batches.note(treelet, context_.slots.waiting(treelet));
    RayBatch batch = context_.slots.rays.take(treelet);
    Result<PagePin> pin = context_.cache.pin(context_.scene.treelets[treelet].geometry, counters_);
    if (!pin.ok()) {
      const std::lock_guard guard(context_.mutex);
      if (context_.error.ok()) context_.error = pin.error();
      context_.ended = true;
      return;
    }
    in_hand_ = treelet, geometry_ = std::move(pin).value();
    ++drains_;
    while (const uint32_t count = batch.next_block(block_)) {
      for (uint32_t i = 0; i < count; ++i) {
        trace(block_.rays[i]);
        route(block_.rays[i]);
      }
    }
    geometry_.reset();
    in_hand_ = kNoIndex;
  }

  void trace(Ray& ray) {
    const TopTree& tree = context_.scene.top_tree;
    trace_treelet(geometry_.bytes(), tree.current(ray), tree.instance(ray.instance), ray, trace_counters_);
    ++visits_;
  }

  void route(Ray& ray) {
    const TopTree& tree = context_.scene.top_tree;
    for (uint32_t entry; (entry = tree.next(ray, trace_counters_.node_tests_count)) != kNoIndex; trace(ray)) {
      const TreeletId treelet = tree.entry(entry).treelet;
      if (treelet != in_hand_) return context_.slots.rays.push(treelet, ray);
    }
    hits_ += ray.hit.valid() ? 1 : 0;
    context_.slots.give_back(path_index_of(ray));
    ++context_.done;
  }

  RandomContext& context_;
  CacheCounters counters_;
  TraceCounters trace_counters_;
  uint64_t visits_ = 0, drains_ = 0, hits_ = 0;
  TreeletId in_hand_ = kNoIndex;
  PagePin geometry_;
  RayBlock block_;
};

Status write_stats(const RandomRun& run, const RandomContext& context, double seconds) {
  const CacheCounters& c = context.counters;
  const nlohmann::ordered_json json = {
      {"seconds", seconds},         {"rays_traced_count", context.starts.size()},
      {"ray_hits_count", context.hits}, {"treelet_visits_count", context.visits},
      {"treelet_batches_count", context.drains}, {"disk_read_bytes", c.disk_read_bytes},
      {"treelet_loads_count", c.treelet_loads_count}, {"treelet_load_bytes", c.treelet_load_bytes}};
  const std::string text = json.dump(1) + "\n";
  return write_whole_file(posix_file_system(), run.stats, std::as_bytes(std::span(text)));
}

}  // namespace

Status trace_random_rays(const RandomRun& run) {
  SHOAL_ASSIGN_OR_RETURN(Scene scene, open_scene(posix_file_system(), run.scene, ReadMode::kDirect, {}));
  if (scene.top_tree.instance_count() != 1) {
    return Error{ErrorCode::kUsage, run.scene + ": random rays need a scene of one instance (terrain, tile)"};
  }
  SHOAL_ASSIGN_OR_RETURN(const std::vector<RayStart> starts, make_starts(scene, run.rays));
  for (TreeletPages& pages : scene.treelets) pages.attributes = kNoPage;  // nothing is shaded
  const unsigned threads = run.threads > 0 ? run.threads : std::max(1u, std::thread::hardware_concurrency());
  const auto treelets = static_cast<uint32_t>(scene.treelets.size());
  const auto in_flight = static_cast<uint32_t>(std::min<uint64_t>(run.in_flight, kMaxPathsInFlight));
  QueuedPaths slots(treelets, in_flight, threads);
  UsualBatches batches(treelets);
  const std::vector<TreeletId> page_treelets = treelet_of_pages(scene);
  PageCache cache(
      *scene.file, run.page_cache_bytes, {},
      [&](PageId page) -> PageDemand {
        const TreeletId id = page_treelets[page];
        return id == kNoIndex ? PageDemand() : PageDemand(slots.waiting(id), batches.of(id));
      },
      PagingOptions{});
  const PolicyOptions options = scaled_policy({.rays_ahead = run.rays_ahead}, {}, treelets, in_flight);
  const std::unique_ptr<DrainPolicy> policy = make_drain_policy(run.policy, options);
  if (policy == nullptr) return Error{ErrorCode::kUsage, "unknown policy " + run.policy};
  TreeletScheduler scheduler(scene, slots, cache, *policy, batches, page_treelets);
  RandomContext context{scene, starts, slots, scheduler, batches, cache};
  const double start = now_seconds();
  run_on_threads(threads, [&](unsigned) { std::make_unique<RandomWorker>(context)->run(); });
  cache.finish_loads();
  SHOAL_RETURN_IF_ERROR(context.error);
  context.counters.add(cache.background_counters());
  return write_stats(run, context, now_seconds() - start);
}

}  // namespace shoal::bench
