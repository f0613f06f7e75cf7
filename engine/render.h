// Rendering: options, and the orders over the same treelets, pages and kernels.
// Called by bins and tests. The picture depends on the scene and on PictureOptions only; everything in
// ExecutionOptions changes time and traffic, never a bit; but for a time limit, which chooses how many samples there are.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/aov.h"
#include "engine/checkpoint_options.h"
#include "engine/counters.h"
#include "engine/lens.h"
#include "engine/memory_plan.h"
#include "engine/noise_target.h"
#include "engine/phase_clock.h"
#include "engine/sample_order.h"
#include "engine/scene.h"
#include "engine/shade.h"
#include "engine/tonemap.h"
#include "io/image.h"
#include "io/page_loader.h"
#include "io/result.h"
#include "queues/drain_policy.h"

namespace shoal {

class RenderRecord;
class TouchRecorder;

struct PictureOptions {
  uint32_t width = 512, height = 512;
  uint32_t samples = 16;  ///< with a target for noise: at most
  SampleSpan range;       ///< of `samples`, those that are drawn; without any: all
  NoiseTarget noise;      ///< asked for: samples are drawn where it is not met (engine/adaptive_sampling.h)
  uint32_t camera = 0;  ///< index among the scene's cameras; a scene without one is framed
  LensOptions lens;     ///< what the picture asks of the camera beyond its record
  uint32_t tile_sample = 1;  ///< for measuring: one in so many 32 x 32 tiles is rendered, the others stay black
  ShadingOptions shading;
  AovSet aovs;  ///< layers beside the colour, which does not depend on them
};

/// kPacket and what follows it trace in memory as kHybrid does; the last two are kDepthFirst by another inner loop.
enum class Order : uint8_t {
  kAuto,
  kQueued,
  kDepthFirst,
  kSorted,
  kHybrid,
  kPacket,
  kPacketReorder,
  kStream,
  kDepthFirstWhileWhile,
  kDepthFirstIfIf,
};

/// By whichever inner loop.
constexpr bool is_depth_first(Order order) {
  return order == Order::kDepthFirst || order == Order::kDepthFirstWhileWhile || order == Order::kDepthFirstIfIf;
}
/// Only where the page cache has room for every page.
constexpr bool needs_every_page(Order order) {
  return order == Order::kHybrid || order == Order::kPacket || order == Order::kPacketReorder || order == Order::kStream;
}

std::string_view order_name(Order order);

/// The order that renders, never kAuto, and why.
struct ChosenOrder {
  Order order = Order::kQueued;
  std::string reason;
};

/// A picture that is written while the render goes on (engine/preview.h).
struct PreviewOptions {
  std::string path;  ///< .png; empty: none
  ToneMapOptions tone;
};

struct ExecutionOptions {
  Order order = Order::kAuto;       ///< kAuto: what is fastest for scene and cap (engine/choose_order.h)
  unsigned threads = 0;             ///< 0: all
  uint64_t max_memory_bytes = 0;    ///< of the whole process; 0: default_cap_bytes() (engine/process_memory.h)
  uint64_t process_bytes = 0;       ///< of plan_before_tables(), so that every plan says the same; 0: measured
  uint64_t page_cache_bytes = 0;    ///< 0: from the plan
  /// 0: from the plan. Two a path, at least one block (64), at most 2 kMaxPathsInFlight.
  uint64_t rays_in_flight = 0;
  std::string policy = "resident-first";
  PolicyOptions policy_options;
  uint32_t packet_rays = 64;        ///< kPacket, kPacketReorder: rays of a packet, a power of two from 16 to 256
  TouchRecorder* touches = nullptr;  ///< for measuring: told what every thread touches (engine/touch_recorder.h)
  const MappedPages* mapped_pages = nullptr;  ///< for measuring depth-first: serves all pages, not the page cache
  PagingOptions paging;             ///< queued only: depth-first reads what it needs when it needs it
  PreviewOptions preview;
  CheckpointOptions checkpoint;
  std::string sums_path;            ///< raw sums are written there (engine/sums_file.h) instead of making a picture
  /// Ends the render when so many seconds have gone by since it began, within a pass (engine/pass_plan.h): with the
  /// picture of RenderResult::samples samples a pixel. Those of renders that it goes on from count. 0: none.
  double time_limit_seconds = 0;
  RenderRecord* record = nullptr;  ///< keeps what the render does over time (engine/render_record.h), or none
};

/// The first preview that was there to be looked at.
struct FirstPicture {
  double seconds = 0;      ///< since the render began, until the file stood under its name
  double pixel_share = 0;  ///< share of the pixels that had a sample of their own; the others showed a neighbour
};

struct RenderProgress {
  uint64_t samples_done = 0, samples_total = 0;
  uint64_t disk_read_bytes = 0;
  double seconds = 0;
  std::optional<FirstPicture> first_picture;  ///< as soon as there is one; never without a preview
  double fraction = 0;                 ///< of the work, or of the time limit, that is done: whichever is more
  std::optional<double> seconds_left;  ///< as far as that can be told yet
  uint64_t samples_before = 0;         ///< of samples_done, those of a render that this one goes on from
};

class RayRecorder;

struct RenderHooks {
  std::function<void(const MemoryPlan&)> planned;       ///< may be empty; called once, before work starts
  std::function<void(const ChosenOrder&)> chosen;       ///< may be empty; for Order::kAuto, once more when trials chose another time
  std::function<void(const RenderProgress&)> progress;  ///< may be empty; now and then, one call at a time
  std::function<void(const std::string&)> warning;      ///< may be empty; what went wrong and does not end the render
  const std::atomic<bool>* stop = nullptr;              ///< ends the render with kStopped when it becomes true
  RayRecorder* recorder = nullptr;                      ///< takes every ray that is born (engine/ray_recorder.h); none: no cost
};

/// The samples that make up the pixels.
struct SampleReport {
  uint32_t least = 0, most = 0;  ///< of a pixel that is rendered
  double mean = 0;
  double drawn_mean = 0;         ///< with those that only helped to decide where to draw more
  uint32_t passes_count = 0;     ///< between which all threads waited for the last one
};

struct RenderResult {
  std::vector<float> rgba;  ///< width * height * 4; none with ExecutionOptions::sums_path
  SampleReport samples;
  std::optional<NoiseReached> noise;   ///< with a target for noise, when there were enough samples to tell
  std::vector<float> standard_errors;  ///< then: width * height, of luminance
  std::vector<ExrChannel> layers;  ///< of the AOVs asked for
  RenderCounters counters;
  MemoryPlan plan;
  ChosenOrder order;
  double seconds = 0;
  unsigned threads = 0;
  PhaseTimes phases;  ///< of all threads: sums to threads * seconds
  uint64_t peak_cache_bytes = 0;
  std::string read_backend;  ///< PageCache::read_backend()
  double picture_share = 1;  ///< share of the pixels that were rendered (PictureOptions::tile_sample)
  std::optional<FirstPicture> first_picture;  ///< none without a preview, or when none could be written
  std::optional<ResumedFrom> resumed;  ///< went on from a checkpoint: counters and seconds are of what came after
  uint32_t previews_count = 0;                ///< written while rendering
  double preview_seconds = 0;                 ///< spent drawing and writing them, summed over threads
};

/// Sizes and samples that can be rendered. Fails with: kUsage.
Status check_picture(const PictureOptions& picture);

/// Renders and checks the counters' identities. Fails with: kInternal (they do not balance), kCorrupt, kStorage,
/// kMemoryCap, kStopped (with a checkpoint, it is written), kInput (environment, a checkpoint of another picture).
Result<RenderResult> render(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                            const ExecutionOptions& execution, const RenderHooks& hooks = {});

}  // namespace shoal
