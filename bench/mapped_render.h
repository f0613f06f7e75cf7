// The rival that the operating system pages for: depth-first over memory-mapped decoded pages. A program of its own
// within bench/out_of_core, so that it can run in a memory group.
#pragma once

#include <string>

#include "engine/render.h"

namespace shoal::bench {

struct MappedRender {
  std::string scene, pages, advice = "normal", order = "depth-first", picture, stats;
  PictureOptions options;
  unsigned threads = 0;
  bool quiet = false;
};

/// Writes the decoded pages of a scene to `path` unless a file of that size is there.
Status make_mapped_pages(const std::string& scene, const std::string& path);
/// Renders; writes picture and stats as `shoal render` does.
Status mapped_render(const MappedRender& ask);

}  // namespace shoal::bench
