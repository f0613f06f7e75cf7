// Parts of a picture, rendered anywhere, made one: the raw sums of ranges of samples are added, which gives the bits of one
// render. Called by bins/command_merge.
// Thread rule: plain functions. Memory: the sums of the picture and its layers, then their floats (the memory plan of a
// render has the same under film and AOVs). Cost: reads every part once, its header and texts twice; one is open at a time.
#pragma once

#include <string>
#include <vector>

#include "io/file.h"
#include "io/image.h"
#include "io/result.h"

namespace shoal {

struct MergedPicture {
  ExrImage image;
  uint32_t samples = 0;   ///< a pixel
  double seconds = 0;     ///< of rendering, all parts together
};

/// Fails with: kInput (parts of different pictures, that overlap, or with samples missing: the message says which; no
/// part; one was written anew meanwhile), kCorrupt, kStorage.
Result<MergedPicture> merge_parts(FileSystem& fs, const std::vector<std::string>& paths);

}  // namespace shoal
