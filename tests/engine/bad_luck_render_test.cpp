// Whatever read fails in the middle of a render, in any order: it ends with the right code and names file and page; a
// read ahead that fails harms nothing, or ends the render likewise.
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>

#include "engine/build_scene.h"
#include "engine/camera.h"
#include "engine/render.h"
#include "io/page_cache.h"
#include "tests/engine/bad_luck_scene.h"
#include "tests/support/faulty_file_system.h"

namespace shoal::testing {
namespace {

struct Way {
  const char* name;
  Order order;
  unsigned threads;
  uint32_t read_depth;  ///< 0: every page is read when it is needed, so that no failed read may go unnoticed
  bool preview = false;  ///< other samples are held back until those of its first lattice have ended
};

const Way kWays[] = {{"depth-first", Order::kDepthFirst, 1, 0},
                     {"depth-first, two threads", Order::kDepthFirst, 2, 0},
                     {"sorted", Order::kSorted, 1, 0},
                     {"sorted, two threads", Order::kSorted, 2, 0},
                     {"hybrid", Order::kHybrid, 1, 0},
                     {"hybrid, two threads", Order::kHybrid, 2, 0},
                     {"queued", Order::kQueued, 1, 0},
                     {"queued, reading ahead", Order::kQueued, 2, 8},
                     {"depth-first, two threads, with a preview", Order::kDepthFirst, 2, 0, true},
                     {"queued, reading ahead, with a preview", Order::kQueued, 2, 8, true}};

class BadLuckRender : public ::testing::Test {
 protected:
  void SetUp() override {
    save_bad_luck_scene(memory_, 2000);
    SceneBuildOptions options;
    options.threads = 1;
    options.treelet_bytes = 4u << 10;
    ASSERT_TRUE(build_scene(memory_, "scene.gltf", "scene.shoal", options).ok());
  }

  Result<RenderResult> render_way(const Way& way) {
    SHOAL_ASSIGN_OR_RETURN(const Scene scene, open_scene(fs_, "scene.shoal", ReadMode::kDirect, {}));
    PictureOptions picture;
    picture.width = picture.height = 8;
    picture.samples = way.preview ? 2 : 1;
    picture.shading.environment.kind = EnvironmentOptions::Kind::kConstant;
    picture.shading.texture_filter = TextureFilter::kBilinear;  // many tiles, each full of texels
    ExecutionOptions execution;
    execution.order = way.order;
    execution.threads = way.threads;
    execution.rays_in_flight = 64;
    execution.paging.read_depth = way.read_depth;
    if (way.order != Order::kHybrid) {
      execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*scene.file, way.threads);
    }
    opening_calls_ = fs_.calls();
    if (way.preview) execution.preview.path = "preview.png";
    MemoryFileSystem previews;
    return render(previews, scene, picture, execution);
  }

  /// Harms every read of the render in turn, but for those of opening the scene, until none is left.
  void harm_every_read(const Way& way, Fault fault) {
    fs_.arm(Fault::kNone, 0);
    const auto clean = render_way(way);
    ASSERT_TRUE(clean.ok()) << clean.error().message;
    fs_.arm(fault, ~uint64_t{0});
    ASSERT_TRUE(render_way(way).ok());
    uint64_t failures = 0;
    for (uint64_t call = opening_calls_; call < opening_calls_ + kMostCalls; ++call) {
      fs_.arm(fault, call);
      const auto result = render_way(way);
      const bool harmed = fs_.calls() > call;
      if (result.ok()) {
        EXPECT_TRUE(!harmed || way.read_depth > 0) << way.name << ": read " << call << " failed and nobody noticed";
        ASSERT_EQ(result.value().rgba.size(), clean.value().rgba.size());
        EXPECT_EQ(std::memcmp(result.value().rgba.data(), clean.value().rgba.data(),
                              clean.value().rgba.size() * sizeof(float)), 0) << way.name << " read " << call;
        if (!harmed) break;
        continue;
      }
      ++failures;
      const Error& error = result.error();
      EXPECT_EQ(error.code, fault == Fault::kBitFlip ? ErrorCode::kCorrupt : ErrorCode::kStorage)
          << way.name << " read " << call << ": " << error.message;
      EXPECT_NE(error.message.find("scene.shoal"), std::string::npos) << error.message;
      EXPECT_NE(error.message.find("at offset"), std::string::npos) << error.message;
    }
    EXPECT_GT(failures, 10u) << way.name;
    EXPECT_EQ(memory_.names(), names_);
  }

  static constexpr uint64_t kMostCalls = 300;  // enough: which page is read last makes no difference
  const std::vector<std::string> names_{"image0.png", "scene.bin", "scene.gltf", "scene.shoal"};
  MemoryFileSystem memory_;
  FaultyFileSystem fs_{memory_};
  uint64_t opening_calls_ = 0;
};

TEST_F(BadLuckRender, ADiskThatFailsEndsItAtAnyRead) {
  for (const Way& way : kWays) harm_every_read(way, Fault::kIoError);
}

TEST_F(BadLuckRender, AReadCutShortEndsItAtAnyRead) {
  for (const Way& way : kWays) harm_every_read(way, Fault::kShortRead);
}

TEST_F(BadLuckRender, APageWithAFlippedBitEndsItAtAnyRead) {
  for (const Way& way : kWays) harm_every_read(way, Fault::kBitFlip);
}

TEST_F(BadLuckRender, ADiskThatFailsForGoodEndsEveryWay) {
  for (const Way& way : kWays) {
    for (const uint64_t call : {0, 7, 15}) {
      fs_.arm(Fault::kNone, 0);
      ASSERT_TRUE(render_way(way).ok());
      fs_.arm(Fault::kShortRead, ~uint64_t{0});
      ASSERT_TRUE(render_way(way).ok());
      fs_.arm(Fault::kShortRead, opening_calls_ + call, true);
      const auto result = render_way(way);
      ASSERT_FALSE(result.ok()) << way.name << " from read " << call;
      EXPECT_EQ(result.error().code, ErrorCode::kStorage);
    }
  }
}

TEST_F(BadLuckRender, AStopIsHeardWhereCameraRaysSeeNothing) {
  Result<Scene> scene = open_scene(memory_, "scene.shoal", ReadMode::kDirect, {});
  ASSERT_TRUE(scene.ok());
  CameraRecord camera = frame_camera(scene.value().top_tree.bounds());
  camera.camera_to_world.translation = camera.camera_to_world.translation + Vec3{1e6f, 0, 0};
  scene.value().cameras = {camera};
  for (const Order order : {Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid, Order::kAuto}) {
    PictureOptions picture;
    picture.width = picture.height = 256;
    picture.samples = 1u << 16;  // minutes, were it not stopped
    ExecutionOptions execution;
    execution.order = order;
    execution.max_memory_bytes = 256ull << 20;
    execution.process_bytes = 16u << 20;  // a sanitizer takes hundreds of MiB for itself
    std::atomic<bool> stop = false;
    RenderHooks hooks;
    hooks.stop = &stop;
    hooks.progress = [&](const RenderProgress&) { stop = true; };
    const auto result = render(memory_, scene.value(), picture, execution, hooks);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::kStopped);
  }
}

}  // namespace
}  // namespace shoal::testing
