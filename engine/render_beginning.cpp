#include "engine/render_beginning.h"

#include "engine/picture_identity.h"

namespace shoal {

Result<RenderSums> RenderSums::create(const Scene& scene, const PictureOptions& picture, unsigned threads) {
  const uint32_t width = picture.width, height = picture.height;
  RenderSums sums{Film(width, height, picture.noise.asked() ? 2 : 1), {}, {}};
  if (picture.noise.asked()) sums.adaptive.emplace(width, height, picture.noise, threads);
  if (!picture.aovs.empty()) {
    SHOAL_ASSIGN_OR_RETURN(sums.aovs, AovFilm::create(picture.aovs, width, height, *scene.file));
  }
  return sums;
}

SampleOrder order_of(const PictureOptions& picture, SampleSpan span, const AdaptiveSampling* adaptive,
                     uint32_t coarse_levels) {
  if (adaptive != nullptr && !adaptive->whole_picture()) {
    return SampleOrder(picture.width, picture.height, span, adaptive->blocks());
  }
  return SampleOrder(picture.width, picture.height, span, picture.tile_sample, coarse_levels);
}

Result<RenderBeginning> RenderBeginning::find(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                                              ExecutionOptions& execution) {
  RenderBeginning beginning;
  if (execution.checkpoint.path.empty() && execution.sums_path.empty()) return beginning;
  SHOAL_ASSIGN_OR_RETURN(beginning.identity, picture_identity(fs, scene, picture));
  if (!execution.checkpoint.resume) return beginning;
  SHOAL_ASSIGN_OR_RETURN(beginning.earlier,
                         open_checkpoint(fs, execution.checkpoint.path, beginning.identity, picture));
  execution.checkpoint.unfinished_count = beginning.earlier->header().unfinished_count;
  return beginning;
}

Result<uint32_t> RenderBeginning::first_pass(const PictureSums& sums, PassPlan& passes, uint32_t coarse_levels,
                                             double seconds) const {
  if (!earlier) {
    passes.next(seconds);
    return coarse_levels;
  }
  SHOAL_RETURN_IF_ERROR(earlier->read_sums(sums));
  passes.resume(earlier->header().pass);
  return earlier->header().coarse_levels;
}

Status RenderBeginning::begin(RenderContext& context) {
  if (!earlier) return {};
  SHOAL_RETURN_IF_ERROR(resume_cursor(*earlier, context));
  earlier.reset();
  return {};
}

}  // namespace shoal
