#include "bench/mapped_render.h"

#include <filesystem>
#include <thread>

#include "engine/light_unlit_scene.h"
#include "engine/render_report.h"
#include "io/mapped_pages.h"

namespace shoal::bench {

Status make_mapped_pages(const std::string& path_of_scene, const std::string& path) {
  FileSystem& fs = posix_file_system();
  SHOAL_ASSIGN_OR_RETURN(const Scene scene, open_scene(fs, path_of_scene, ReadMode::kDirect, {}));
  std::error_code code;
  if (std::filesystem::file_size(path, code) == MappedPages::file_bytes(*scene.file) && !code) return {};
  return MappedPages::write(
      fs, *scene.file,
      [&scene](const PageRecord& record, std::span<const std::byte> bytes) { return check_page(scene, record, bytes); },
      path);
}

Status mapped_render(const MappedRender& ask) {
  FileSystem& fs = posix_file_system();
  SHOAL_ASSIGN_OR_RETURN(Scene scene, open_scene(fs, ask.scene, ReadMode::kDirect, {}));
  const MapAdvice advice = ask.advice == "random" ? MapAdvice::kRandom : MapAdvice::kNormal;
  SHOAL_ASSIGN_OR_RETURN(const std::unique_ptr<MappedPages> pages, MappedPages::open(*scene.file, ask.pages, advice));
  PictureOptions picture = ask.options;
  ExecutionOptions execution;
  execution.order = Order::kDepthFirst;
  execution.threads = ask.threads > 0 ? ask.threads : std::max(1u, std::thread::hardware_concurrency());
  execution.max_memory_bytes = 1ull << 50;  // the group that it runs in is the limit
  execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*scene.file, execution.threads);  // not used
  execution.mapped_pages = pages.get();
  SHOAL_RETURN_IF_ERROR(light_unlit_scene(fs, scene, picture, execution));
  SHOAL_ASSIGN_OR_RETURN(const RenderResult result, render(fs, scene, picture, execution));
  SHOAL_RETURN_IF_ERROR(write_exr(fs, ask.picture, picture_image(result, scene, picture)));
  const std::string json = stats_json(result, scene, picture, execution);
  return write_whole_file(fs, ask.stats, std::as_bytes(std::span(json)));
}

}  // namespace shoal::bench
