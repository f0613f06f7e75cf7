// A small scene, ways to render it, and renders that are stopped at random. Used by tests of checkpoints and of
// parts.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <thread>

#include "engine/build_scene.h"
#include "engine/clock.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/render_variation.h"
#include "tests/support/same_bits.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {

inline const RenderVariation kPlainWay{.name = "depth-first, one thread", .order = Order::kDepthFirst, .threads = 1};
inline const RenderVariation kRenderWays[] = {
    {.name = "queued", .threads = 3},
    {.name = "depth-first", .order = Order::kDepthFirst},
    {.name = "sorted", .order = Order::kSorted, .threads = 3},
    {.name = "hybrid", .order = Order::kHybrid},
    {.name = "auto", .order = Order::kAuto, .threads = 3},
    {.name = "queued, smallest cache", .rays_in_flight = 2000, .smallest_cache = true},
    {.name = "queued, one block of rays, with a preview", .threads = 1, .rays_in_flight = 64, .preview = true},
    {.name = "sorted, small waves, smallest cache",
     .order = Order::kSorted,
     .rays_in_flight = 1000,
     .smallest_cache = true},
    {.name = "depth-first, smallest cache, with a preview",
     .order = Order::kDepthFirst,
     .threads = 3,
     .smallest_cache = true,
     .preview = true},
};

class StoppedRender : public ::testing::Test {
 protected:
  static constexpr const char* kCheckpoint = "picture.checkpoint";

  void SetUp() override {
    GenerateOptions options;
    options.kind = "demo";
    options.triangles = 3000;
    options.out_dir = folder_ / "demo";
    const auto report = generate_scene(posix_file_system(), options);
    ASSERT_TRUE(report.ok());
    SceneBuildOptions build;
    build.treelet_bytes = 4u << 10;
    ASSERT_TRUE(build_scene(posix_file_system(), report.value().gltf_path, folder_ / "scene.shoal", build).ok());
    picture_.width = 40, picture_.height = 32, picture_.samples = 4;
    picture_.shading.bounces = 4;
    picture_.aovs = parse_aovs("albedo,normal,depth,position,variance,samples,object_id,material_id").value();
  }

  Result<RenderResult> rendered(FileSystem& fs, const RenderVariation& way, const CheckpointOptions& checkpoint,
                                const std::atomic<bool>* stop = nullptr) {
    ExecutionOptions execution;
    execution.time_limit_seconds = time_limit_;
    execution.checkpoint = checkpoint;
    execution.sums_path = sums_path_;
    if (way.preview) execution.preview.path = "preview.png";  // in `fs`
    RenderHooks hooks;
    hooks.stop = stop;
    hooks.warning = [this](const std::string& warning) { warnings_.push_back(warning); };
    return try_variation(fs, folder_, picture_, way, execution, hooks);
  }

  RenderResult whole(const RenderVariation& way = kPlainWay) {
    auto result = rendered(files_, way, {});
    if (!result.ok()) throw std::runtime_error(result.error().message);
    return std::move(result).value();
  }

  /// Stops it after so many seconds, if it takes as long.
  Result<RenderResult> stopped_after(double seconds, const RenderVariation& way, FileSystem& fs) {
    std::atomic<bool> stop{seconds <= 0};
    std::atomic<bool> over{false};
    std::thread stopper([&] {
      const double end = now_seconds() + seconds;
      while (!over && now_seconds() < end) std::this_thread::sleep_for(std::chrono::microseconds(100));
      stop = true;
    });
    auto result = rendered(fs, way, {.path = kCheckpoint, .resume = files_.exists(kCheckpoint)}, &stop);
    over = true;
    stopper.join();
    return result;
  }

  /// Makes a checkpoint of a render that has done something.
  void make_checkpoint(const RenderVariation& way = kRenderWays[0]) {
    for (double seconds = 0.02; !files_.exists(kCheckpoint); seconds *= 0.7) {
      const auto result = stopped_after(seconds, way, files_);
      ASSERT_TRUE(result.ok() || result.error().code == ErrorCode::kStopped) << result.error().message;
    }
  }

  Result<RenderResult> resumed(const RenderVariation& way = kPlainWay) {
    return rendered(files_, way, {.path = kCheckpoint, .resume = true});
  }

  static void expect_same(const RenderResult& actual, const RenderResult& expected, const std::string& what) {
    EXPECT_EQ(actual.rgba, expected.rgba) << what;
    EXPECT_EQ(actual.standard_errors, expected.standard_errors) << what;
    ASSERT_EQ(actual.layers.size(), expected.layers.size());
    for (size_t i = 0; i < expected.layers.size(); ++i) {
      const ExrChannel &a = actual.layers[i], &b = expected.layers[i];
      EXPECT_EQ(a.integers, b.integers) << what << ", " << b.name;
      EXPECT_TRUE(same_bits(a.values, b.values)) << what << ", " << b.name;
    }
  }

  /// Stops the render again and again, each time in another way, until it is complete: then its bits are those of
  /// `expected`.
  void expect_same_however_stopped(const RenderResult& expected, uint32_t renders) {
    std::mt19937 random(7);
    uint32_t stops = 0;
    // Stops come by the clock: on a busy machine some come too late, and more renders are needed.
    for (uint32_t render = 0; render < renders || (stops <= renders && render < 20 * renders); ++render) {
      files_.remove(kCheckpoint).ok();
      std::string ways;
      for (uint32_t part = 0;; ++part) {
        const RenderVariation& way = kRenderWays[random() % std::size(kRenderWays)];
        ways += std::string(way.name) + "; ";
        const double longest = part < 6 ? 0.6 * expected.seconds : 100;
        const auto result = stopped_after(longest * (random() % 1000) * 1e-3, way, files_);
        if (result.ok()) {
          expect_same(result.value(), expected, ways);
          EXPECT_EQ(result.value().resumed.has_value(), part > 0);
          break;
        }
        ASSERT_EQ(result.error().code, ErrorCode::kStopped) << result.error().message;
        EXPECT_NE(result.error().message.find(kCheckpoint), std::string::npos);
        ++stops;
        if (part > 6) FAIL() << "it is never complete";
      }
      if (HasFailure()) return;
    }
    EXPECT_GT(stops, renders) << "renders that are not stopped prove nothing";
  }

  TemporaryFolder folder_;
  MemoryFileSystem files_;
  PictureOptions picture_;
  double time_limit_ = 0;
  std::string sums_path_;
  std::vector<std::string> warnings_;
};

}  // namespace shoal::testing
