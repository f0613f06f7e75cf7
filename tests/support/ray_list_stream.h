// A list of rays as a stream for SceneTracer, with the pages of a hand-made scene that are brought one by one.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/hand_made_scene.h"
#include "treelets/scene_traversal.h"

namespace shoal::testing {

class RayListStream final : public RayStream {
 public:
  /// At most `most_out` rays are out at once; with `hesitates`, it says now and then that there is none for now.
  RayListStream(std::vector<Ray>& rays, const TestScene& scene, size_t most_out = SIZE_MAX, bool hesitates = false)
      : table(scene.pages.size()), done_(rays.size()), rays_(rays), scene_(scene), most_out_(most_out),
        hesitates_(hesitates) {}
  Ray* next() override {
    const bool none = next_ == rays_.size() || next_ - done_count >= most_out_ || (hesitates_ && ++asked_ % 7 == 1);
    return none ? nullptr : &rays_[next_++];
  }
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
  const size_t most_out_;
  const bool hesitates_;
  size_t next_ = 0, asked_ = 0;
};

/// All of them from start to end, by SceneTracer: the rays at their ends.
inline std::vector<Ray> trace_together(const TopTree& tree, const TestScene& scene, std::vector<Ray> rays,
                                       RayGrouping grouping,
                                       TriangleTest test = TriangleTest::kWatertight) {
  RayListStream stream(rays, scene);
  TraceCounters counters;
  SceneTracer(tree, stream.table.data(), grouping, test).trace(stream, counters);
  EXPECT_EQ(stream.done_count, rays.size());
  EXPECT_LE(stream.brought, scene.pages.size());
  return rays;
}

/// The ways of treelets/scene_traversal.h, packets of three sizes.
struct TraversalWay {
  const char* name;
  std::unique_ptr<SceneTraversal> (*make)(const TopTree&, PageTable, TriangleTest);
};
inline constexpr TraversalWay kTraversalWays[] = {
    {"packets of 16", [](const TopTree& tree, PageTable pages, TriangleTest test) {
       return make_packet_traversal(tree, pages, test, 16);
     }},
    {"packets of 256", [](const TopTree& tree, PageTable pages, TriangleTest test) {
       return make_packet_traversal(tree, pages, test, 256);
     }},
    {"reordered packets of 32", [](const TopTree& tree, PageTable pages, TriangleTest test) {
       return make_reordering_traversal(tree, pages, test, 32);
     }},
    {"reordered packets of 256", [](const TopTree& tree, PageTable pages, TriangleTest test) {
       return make_reordering_traversal(tree, pages, test, 256);
     }},
    {"streams", [](const TopTree& tree, PageTable pages, TriangleTest test) {
       return make_stream_traversal(tree, pages, test);
     }},
};

/// All of them from start to end: the rays at their ends. Adds to `counters`.
inline std::vector<Ray> trace_by(const TraversalWay& way, const TopTree& tree, const TestScene& scene,
                                 std::vector<Ray> rays, TraceCounters& counters,
                                 TriangleTest test = TriangleTest::kWatertight) {
  RayListStream stream(rays, scene);
  way.make(tree, stream.table.data(), test)->trace(stream, counters);
  EXPECT_EQ(stream.done_count, rays.size()) << way.name;
  EXPECT_LE(stream.brought, scene.pages.size()) << way.name;
  EXPECT_LE(counters.simd_active_lanes_count, counters.simd_lanes_count) << way.name;
  return rays;
}

}  // namespace shoal::testing
