// Ways to render a built scene that must not show in the picture: order, threads, rays in flight, the smallest cache, a
// preview. For tests of the engine over files.
#pragma once

#include <stdexcept>
#include <string>

#include "engine/render.h"
#include "io/page_cache.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {

struct RenderVariation {
  const char* name;
  Order order = Order::kQueued;
  unsigned threads = 2;
  uint64_t rays_in_flight = 0;
  bool smallest_cache = false;
  bool preview = false;
};

/// Renders `folder`/scene.shoal; `execution` holds what is no part of the variation. What the render writes goes through `fs`.
inline Result<RenderResult> try_variation(FileSystem& fs, const TemporaryFolder& folder, const PictureOptions& picture,
                                          const RenderVariation& v, ExecutionOptions execution, const RenderHooks& hooks) {
  const ReadMode mode = v.smallest_cache ? ReadMode::kDirect : ReadMode::kBuffered;
  const auto scene = open_scene(posix_file_system(), folder / "scene.shoal", mode, {});
  if (!scene.ok()) throw std::runtime_error(scene.error().message);
  execution.order = v.order;
  execution.threads = v.threads;
  execution.rays_in_flight = v.rays_in_flight;
  if (v.smallest_cache) {
    execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*scene.value().file, v.threads);
  }
  if (v.preview && execution.preview.path.empty()) execution.preview.path = folder / "preview.png";
  return render(fs, scene.value(), picture, execution, hooks);
}

/// The same. Throws when anything fails.
inline RenderResult render_variation(const TemporaryFolder& folder, const PictureOptions& picture, const RenderVariation& v,
                                     const ExecutionOptions& execution = {}, const RenderHooks& hooks = {}) {
  auto result = try_variation(posix_file_system(), folder, picture, v, execution, hooks);
  if (!result.ok()) throw std::runtime_error(result.error().message);
  return std::move(result).value();
}

}  // namespace shoal::testing
