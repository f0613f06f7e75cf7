#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "bench/figures.h"
#include "engine/clock.h"
#include "engine/render_report.h"
#include "io/aligned_buffer.h"
#include "io/page_file.h"
#include "io/page_loader.h"

namespace shoal::bench {
namespace {

/// Where pages are decoded to while the whole file is read: as many as are under way.
class PagePlaces {
 public:
  PagePlaces(const PageFile& file, unsigned count) {
    uint64_t largest = kBlockBytes;
    for (const PageRecord& record : file.records()) largest = std::max<uint64_t>(largest, record.raw_bytes);
    for (unsigned i = 0; i < count; ++i) {
      places_.push_back(std::make_unique<std::byte[]>(largest + 64));
      free_.push_back(places_.back().get());
    }
  }
  std::byte* take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !free_.empty(); });
    std::byte* place = free_.back();
    free_.pop_back();
    return place;
  }
  void give_back(std::byte* place, const Status& status) {
    const std::lock_guard guard(mutex_);
    free_.push_back(place);
    if (error_.ok()) error_ = status;
    changed_.notify_one();
  }
  const Status& error() const { return error_; }

 private:
  std::vector<std::unique_ptr<std::byte[]>> places_;
  std::vector<std::byte*> free_;
  std::mutex mutex_;
  std::condition_variable changed_;
  Status error_;
};

/// Seconds to read, verify and decode every page once, in the order of the file, as fast as the loader of a render can
/// with all threads decoding.
double seconds_to_read(const std::string& scene, unsigned threads) {
  const auto file = PageFile::open(posix_file_system(), scene, ReadMode::kDirect);
  if (!file.ok()) give_up(file.error().message);
  PagingOptions paging;
  paging.loader_threads = threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
  PagePlaces places(*file.value(), paging.read_depth);
  const double start = now_seconds();
  {
    PageLoader loader(*file.value(), paging,
                      [&](PageId, std::byte* out, Status status, PageLoader::ReadShare) { places.give_back(out, status); });
    for (const PageRecord& record : file.value()->records()) {
      if (record.kind == PageKind::kTable) continue;
      std::byte* place = places.take();
      while (!loader.try_start(record.id, place)) std::this_thread::yield();
    }
    loader.finish();
  }
  if (!places.error().ok()) give_up(places.error().error().message);
  return now_seconds() - start;
}

}  // namespace

Figure figure_first_picture(const Setup& setup, uint64_t cap_bytes) {
  Figure figure;
  const SceneSizes sizes = scene_sizes(setup.scene);
  RenderAsk ask;
  ask.max_memory_bytes = cap_bytes;
  ask.more = {"--preview", setup.folder + "/preview.png"};
  std::vector<double> reading, first, rendering;
  for (uint32_t i = 0; i < setup.runs && figure.ok; ++i) {
    reading.push_back(seconds_to_read(setup.scene, setup.threads));
    const RenderRun run = run_render(setup, "previewed", ask);
    figure.ok = run.ok() && run.stats["first_picture_seconds"].is_number();
    if (!figure.ok) {
      fmt::print("failed: {}\n", run.process.output);
      break;
    }
    first.push_back(run.stats["first_picture_seconds"]);
    rendering.push_back(run.seconds());
    figure.json["rows"].push_back({{"read_once_seconds", reading.back()}, {"stats", run.stats}});
  }
  if (!figure.ok) return figure;
  const double ratio = median(first) / median(reading);
  fmt::print("{}: {} stored, {} decoded\n", setup.scene, format_bytes(sizes.stored_bytes),
             format_bytes(sizes.decoded_bytes));
  fmt::print("{:>16} {:>16} {:>8} {:>18} {:>16}\n", "reading once", "first picture", "ratio", "finished picture", "of pixels");
  fmt::print("{:>14.2f} s {:>14.2f} s {:>8.2f} {:>16.2f} s {:>14.3f} %\n", median(reading), median(first), ratio,
             median(rendering), 100 * figure.json["rows"][0]["stats"]["first_picture_pixel_share"].get<double>());
  figure.json["read_once_seconds"] = median(reading);
  figure.json["first_picture_seconds"] = median(first);
  figure.json["ratio"] = ratio;
  return figure;
}

}  // namespace shoal::bench
