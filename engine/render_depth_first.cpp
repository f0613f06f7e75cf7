// Depth-first: each path alone from camera to end, its treelets pinned on demand (least recently used leave). The
// baseline that the queued order is compared with: same pages, same kernels, same shading.
#include <chrono>
#include <thread>

#include "engine/render_worker.h"

namespace shoal {
namespace {

constexpr uint64_t kSamplesPerGrab = 256;
/// Of the first lattice of a preview: the other threads wait for who has the last ones.
constexpr uint64_t kFirstSamplesPerGrab = 16;
constexpr std::chrono::microseconds kFirstLatticeWait{200};

class DepthFirstWorker {
 public:
  explicit DepthFirstWorker(RenderContext& context) : context_(context), worker_(context) {}

  void run() {
    while (!context_.ended.load(std::memory_order_relaxed)) {
      const bool first_lattice = context_.next_sample < context_.samples.first_lattice_count();
      const SampleRange samples = context_.begin_samples(first_lattice ? kFirstSamplesPerGrab : kSamplesPerGrab);
      if (samples.first == context_.samples.count()) break;
      for (uint64_t index = samples.first; index < samples.last && run_path(index); ++index) {
      }
      context_.samples_done += samples.size();
      worker_.report_progress();
      if (samples.size() == 0) std::this_thread::sleep_for(kFirstLatticeWait);
    }
    worker_.hand_in();
  }

 private:
  /// Returns false on an error.
  bool run_path(uint64_t index) {
    PathState path;
    Ray ray = worker_.begin_path(index, 0, path);
    if (!travel(ray)) return false;
    worker_.finish_ray(ray, path);
    while ((path.flags & kPathGoesOn) != 0 && path.hit.valid()) {
      if (!worker_.take_in_hand(path.hit.treelet)) return false;
      Ray rays[2];
      const uint32_t count = worker_.shade(0, path, rays);
      if (context_.ended.load(std::memory_order_relaxed)) return false;
      for (uint32_t i = 0; i < count; ++i) {
        if (!travel(rays[i])) return false;
        worker_.finish_ray(rays[i], path);
      }
    }
    if ((path.flags & kPathGoesOn) != 0) worker_.shade_miss(path);
    worker_.end_path(path);
    return true;
  }

  /// Traces the ray through every treelet on its way.
  bool travel(Ray& ray) {
    worker_.begin_ray();
    TreeletId treelet = worker_.next_treelet(ray);
    while (treelet != kNoIndex) {
      if (!worker_.take_in_hand(treelet)) return false;
      worker_.trace(ray);
      const TreeletId before = treelet;
      treelet = worker_.next_treelet(ray);
      if (treelet != kNoIndex && treelet != before) ++worker_.ray_counters(ray).ray_exits_count;
    }
    return true;
  }

  RenderContext& context_;
  RenderWorker worker_;
};

}  // namespace

void render_depth_first(RenderContext& context) {
  run_on_threads(context, [&] { DepthFirstWorker(context).run(); });
}

}  // namespace shoal
