// Renders in several passes: with a time limit the picture has the bits of the same number of samples asked for, in every
// order.
#include <gtest/gtest.h>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/support/render_variation.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

const RenderVariation kVariations[] = {
    {.name = "depth-first", .order = Order::kDepthFirst},
    {.name = "queued", .order = Order::kQueued, .threads = 3},
    {.name = "queued, smallest cache", .order = Order::kQueued, .rays_in_flight = 2000, .smallest_cache = true},
    {.name = "queued, with a preview", .order = Order::kQueued, .preview = true},
    {.name = "sorted", .order = Order::kSorted, .threads = 3},
    {.name = "hybrid", .order = Order::kHybrid},
    {.name = "auto", .order = Order::kAuto, .preview = true},
};

class RenderPasses : public ::testing::Test {
 protected:
  void SetUp() override {
    GenerateOptions options;
    options.kind = "demo";
    options.triangles = 20000;
    options.out_dir = folder_ / "demo";
    const auto report = generate_scene(posix_file_system(), options);
    ASSERT_TRUE(report.ok());
    SceneBuildOptions build;
    build.treelet_bytes = 8u << 10;
    ASSERT_TRUE(build_scene(posix_file_system(), report.value().gltf_path, folder_ / "scene.shoal", build).ok());
    picture_.width = 48, picture_.height = 40;
    picture_.aovs = parse_aovs("albedo,samples,variance,object_id").value();
  }

  RenderResult rendered(const RenderVariation& v, uint32_t samples, double limit_seconds) {
    ExecutionOptions execution;
    execution.time_limit_seconds = limit_seconds;
    picture_.samples = samples;
    return render_variation(folder_, picture_, v, execution, hooks_);
  }

  TemporaryFolder folder_;
  PictureOptions picture_;
  RenderHooks hooks_;
};

TEST_F(RenderPasses, ATimeLimitGivesThePictureOfTheSamplesThatItReports) {
  for (const RenderVariation& v : kVariations) {
    const RenderResult limited = rendered(v, 1u << 22, 0.3);
    EXPECT_EQ(limited.samples.least, limited.samples.most) << v.name;
    EXPECT_EQ(limited.samples.mean, limited.samples.most) << v.name;
    EXPECT_GE(limited.samples.passes_count, 1u) << v.name;
    const RenderResult asked = rendered({.name = "", .order = Order::kHybrid}, limited.samples.most, 0);
    EXPECT_EQ(asked.samples.passes_count, 1u);
    EXPECT_EQ(asked.samples.most, limited.samples.most);
    EXPECT_EQ(limited.rgba, asked.rgba) << v.name << ", " << limited.samples.most << " samples";
    ASSERT_EQ(limited.layers.size(), asked.layers.size());
    for (size_t i = 0; i < asked.layers.size(); ++i) {
      EXPECT_EQ(limited.layers[i].values, asked.layers[i].values) << v.name << ", " << asked.layers[i].name;
      EXPECT_EQ(limited.layers[i].integers, asked.layers[i].integers) << v.name << ", " << asked.layers[i].name;
    }
    EXPECT_EQ(limited.counters.samples_committed_count, uint64_t{48} * 40 * limited.samples.most);
    EXPECT_EQ(limited.counters.total().rays_traced_count, asked.counters.total().rays_traced_count);
  }
}

TEST_F(RenderPasses, ALimitThatIsLongEnoughRendersAllSamplesInManyPasses) {
  for (const RenderVariation& v : kVariations) {
    const RenderResult limited = rendered(v, 6, 1e6);
    EXPECT_EQ(limited.samples.most, 6u) << v.name;
    EXPECT_EQ(limited.samples.passes_count, 3u) << v.name << ": 1, 3, 2";
    EXPECT_EQ(limited.rgba, rendered({.name = "", .order = Order::kDepthFirst, .threads = 1}, 6, 0).rgba) << v.name;
  }
}

TEST_F(RenderPasses, AStopBetweenThemEndsTheRender) {
  std::atomic<bool> stop{false};
  uint64_t seen = 0;
  hooks_.stop = &stop;
  hooks_.progress = [&](const RenderProgress& p) {
    seen = p.samples_done;
    if (p.samples_done >= 48 * 40) stop = true;
  };
  try {
    rendered(kVariations[1], 1u << 22, 60);
    FAIL() << "it was not stopped";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "the render was stopped before it was complete");
  }
  EXPECT_GE(seen, 48u * 40);
}

}  // namespace
}  // namespace shoal::testing
