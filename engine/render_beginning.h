// Where a render begins: with sums of nothing, or with those of the checkpoint that it goes on from. Called by
// engine/render. One thread.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "engine/checkpoint.h"

namespace shoal {

/// What a render adds up.
struct RenderSums {
  Film film;
  std::optional<AdaptiveSampling> adaptive;
  std::unique_ptr<AovFilm> aovs;

  /// Fails with: as AovFilm::create().
  static Result<RenderSums> create(const Scene& scene, const PictureOptions& picture, unsigned threads);
  PictureSums all() { return {film, aovs.get(), adaptive ? &*adaptive : nullptr}; }
};

/// The samples of a pass, of what adaptive sampling (or null) draws of the picture.
SampleOrder order_of(const PictureOptions& picture, SampleSpan span, const AdaptiveSampling* adaptive,
                     uint32_t coarse_levels);

struct RenderBeginning {
  std::string identity;               ///< of the picture; empty where no sums are kept
  std::unique_ptr<SumsFile> earlier;  ///< the checkpoint, or none

  /// Opens what `execution` names, and notes in it how many samples begin again. Fails with: as open_checkpoint().
  static Result<RenderBeginning> find(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                                      ExecutionOptions& execution);

  /// The first pass that is rendered, and the levels of its order, which without a checkpoint are `coarse_levels`.
  /// Reads the sums. Fails with: kCorrupt, kStorage.
  Result<uint32_t> first_pass(const PictureSums& sums, PassPlan& passes, uint32_t coarse_levels,
                              double seconds) const;

  /// What of the pass is in the sums.
  uint64_t done_in_pass() const { return earlier ? earlier->done_in_pass() : 0; }

  /// Sets what is done; the checkpoint is let go. Fails with: kCorrupt, kStorage.
  Status begin(RenderContext& context);
};

}  // namespace shoal
