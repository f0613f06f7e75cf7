// A list of rays as a stream for SceneTracer, with the pages of a hand-made scene that are brought one by one.
#pragma once

#include <vector>

#include "tests/support/hand_made_scene.h"
#include "treelets/trace_scene.h"

namespace shoal::testing {

class RayListStream final : public RayStream {
 public:
  RayListStream(std::vector<Ray>& rays, const TestScene& scene)
      : table(scene.pages.size()), done_(rays.size()), rays_(rays), scene_(scene) {}
  Ray* next() override { return next_ < rays_.size() ? &rays_[next_++] : nullptr; }
  void done(Ray& ray, const RayWork& work) override {
    EXPECT_FALSE(done_[&ray - rays_.data()]);
    done_[&ray - rays_.data()] = true;
    ++done_count;
    treelets += work.treelets;
  }
  const std::byte* bring(TreeletId treelet) override {
    ++brought;
    return table[treelet] = scene_.pages[treelet].bytes().data();
  }

  std::vector<const std::byte*> table;
  size_t done_count = 0, brought = 0;
  uint64_t treelets = 0;

 private:
  std::vector<bool> done_;
  std::vector<Ray>& rays_;
  const TestScene& scene_;
  size_t next_ = 0;
};

/// All of them from start to end, by SceneTracer.
inline std::vector<Ray> trace_together(const TopTree& tree, const TestScene& scene, std::vector<Ray> rays,
                                       RayGrouping grouping) {
  RayListStream stream(rays, scene);
  TraceCounters counters;
  SceneTracer(tree, stream.table.data(), grouping).trace(stream, counters);
  EXPECT_EQ(stream.done_count, rays.size());
  EXPECT_LE(stream.brought, scene.pages.size());
  return rays;
}

}  // namespace shoal::testing
