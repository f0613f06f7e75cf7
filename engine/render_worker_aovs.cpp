// The part of the render worker that AOVs call for: nothing here runs in a render without them.
#include <cmath>

#include "engine/aov_film.h"
#include "engine/render_worker.h"

namespace shoal {
namespace {

bool finite(const SurfaceFeatures& f) {
  const auto numbers = [](const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
  return numbers(f.position) && numbers(f.normal) && numbers(f.albedo) && !std::isnan(f.distance);
}

}  // namespace

void RenderWorker::note_features(PathState& path, uint32_t bounce, bool goes_on) {
  SurfaceFeatures features = shader_.features();
  if (!finite(features)) {
    invalid_.add(InvalidTerm::kSurface, path);
    features.position = features.normal = features.albedo = Vec3(0);
    features.distance = 0;
  }
  if (bounce == 0 && path.seeks == kSeeksSurface) {
    aovs_->add_first_hit(path.pixel, features);
    if (path.sample == 0) aovs_->set_ids(path.pixel, path.hit, features.material);
  }
  path.seeks = features.see_through && goes_on ? kSeeksAlbedo : kSeeksNothing;
  if (path.seeks != kSeeksNothing) return;
  aovs_->add_albedo(path.pixel, features.albedo);
}

void RenderWorker::end_features(const PathState& path, const Vec3& radiance) {
  // What left the scene after a mirror or glass: their colour. The camera's own view of it has no surface.
  if (path.seeks != 0 && path.bounce > 0) aovs_->add_albedo(path.pixel, passed_color(path));
  aovs_->add_radiance(path.pixel, radiance);
}

void RenderWorker::count_treelets(uint32_t pixel, uint64_t count) { visits_aovs_->add_treelets(pixel, count); }

void RenderWorker::charge_loads_to(uint32_t pixel) {
  loads_aovs_->add_bytes(pixel, uncharged_bytes());
  charged_bytes_ = cache_counters_.decoded_bytes;
}

RenderWorker::SharedLoad RenderWorker::load_for(uint64_t sharers) {
  const uint64_t bytes = uncharged_bytes();
  charged_bytes_ = cache_counters_.decoded_bytes;
  return {bytes, sharers};
}

RenderWorker::SharedLoad RenderWorker::load_in_hand(uint64_t sharers) {
  const TreeletPages& pages = context_.scene.treelets[in_hand_];
  SharedLoad load = load_for(sharers);
  load.bytes += loads_aovs_->take_read_ahead(pages.geometry);
  if (pages.attributes != kNoPage) load.bytes += loads_aovs_->take_read_ahead(pages.attributes);
  return load;
}

void RenderWorker::charge_share(uint32_t pixel, SharedLoad& load) {
  const uint64_t share = load.bytes / load.sharers--;
  load.bytes -= share;
  loads_aovs_->add_bytes(pixel, share);
}

}  // namespace shoal
