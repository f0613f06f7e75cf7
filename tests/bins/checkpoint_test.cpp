// `shoal render` stopped by signals and gone on with, by itself, in parts and in batches: the same bits.
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "tests/bins/batch_folder.h"
#include "tests/support/sanitized.h"

namespace shoal::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

namespace stdfs = std::filesystem;

class CheckpointProgram : public ::testing::Test {
 protected:
  void SetUp() override { make_terrain(folder_, "2K"); }

  /// A picture of `samples`: 48 take a moment, kMany for ever.
  std::vector<std::string> render(const std::vector<std::string>& more = {}, const std::string& samples = "48",
                                  const std::string& output = "out.exr") const {
    return join({"render", folder_ / "terrain.shoal", "-o", folder_ / output, "--width", "64", "--height", "48",
                 "--spp", samples, "--aov", "albedo,variance,object_id"},
                more);
  }
  static constexpr const char* kMany = "4000000";
  void expect_identical(const std::string& a, const std::string& b) const {
    expect_exit(run_shoal(folder_, {"diff", folder_ / a, folder_ / b}), 0);
  }
  bool there(const std::string& name) const { return stdfs::exists(folder_ / name); }

  /// Starts it, waits until it renders and a little more, and sends `signal`.
  ProgramRun stopped(const std::vector<std::string>& arguments, int signal, int milliseconds) {
    Program program(folder_, join(join({SHOAL_BINARY}, arguments), {"--progress", "json"}));
    while (program.running() && program.err().find("\"rendering\"") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    program.send(signal);
    return program.wait();
  }

  TemporaryFolder folder_;
};

TEST_F(CheckpointProgram, ARenderThatASignalStopsLeavesItsTraceWhole) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const std::string trace = folder_ / "trace.json";
    expect_exit(stopped(join(render({}, kMany), {"--trace", trace, "--threads", "2"}), signal, 30), 9);
    const auto json = nlohmann::json::parse(file_text(trace), nullptr, false);
    ASSERT_TRUE(json.is_object());
    const auto& events = json["traceEvents"];
    EXPECT_TRUE(std::any_of(events.begin(), events.end(), [](const auto& event) { return event["ph"] == "X"; }));
    EXPECT_EQ(json["traceEvents"].back()["name"], "process_name") << "what is written last";
    stdfs::remove(trace);
  }
  EXPECT_FALSE(there("out.exr"));
}

TEST_F(CheckpointProgram, SignalsLeaveACheckpointAndResumeEndsInTheSameBits) {
  expect_exit(run_shoal(folder_, join(render({}, "48", "whole.exr"), {"--quiet"})), 0);
  const std::vector<std::vector<std::string>> ways = {{"--order", "depth-first"},
                                                      {"--order", "sorted", "--threads", "1"},
                                                      {"--order", "hybrid"},
                                                      {"--order", "queued", "--max-memory", kSanitized ? "1G" : "64M"}};
  std::mt19937 random(3);
  uint32_t stops = 0;
  for (const int signal : {SIGTERM, SIGINT}) {
    for (uint32_t part = 0; part < 4; ++part) {
      const ProgramRun run =
          stopped(join(render(ways[part]), {"--resume"}), signal, static_cast<int>(random() % 60));
      if (run.exit_code == 0) break;
      expect_exit(run, 9);
      EXPECT_THAT(run.err, HasSubstr("the render was stopped before it was complete; --resume goes on from"));
      EXPECT_THAT(run.err, HasSubstr("out.exr.checkpoint"));
      EXPECT_TRUE(there("out.exr.checkpoint"));
      EXPECT_FALSE(there("out.exr"));
      ++stops;
    }
    expect_exit(run_shoal(folder_, join(render({"--resume"}), {"--stats", folder_ / "stats.json"})), 0);
    expect_identical("out.exr", "whole.exr");
    stdfs::remove(folder_ / "out.exr");
  }
  EXPECT_GE(stops, 2u);
  EXPECT_FALSE(there("out.exr.checkpoint")) << "of a picture that is complete";
  const auto stats = nlohmann::json::parse(file_text(folder_ / "stats.json"), nullptr, false);
  ASSERT_TRUE(stats.contains("resumed_from"));
  EXPECT_THAT(folder_.names(), ElementsAre("stats.json", "terrain", "terrain.shoal", "whole.exr"));
}

TEST_F(CheckpointProgram, OneThatIsKilledGoesOnFromItsLastCheckpoint) {
  expect_exit(run_shoal(folder_, join(render({}, "48", "whole.exr"), {"--quiet"})), 0);
  std::mt19937 random(4);
  uint32_t kills = 0;
  for (uint32_t part = 0; part < 8; ++part) {
    const std::vector<std::string> every = {"--checkpoint", "every=0.01s", "--resume"};
    const ProgramRun run = stopped(render(every), SIGKILL, static_cast<int>(random() % 50));
    if (run.exit_code == 0) break;
    EXPECT_EQ(run.signal, SIGKILL);
    ++kills;
  }
  EXPECT_GE(kills, 1u);
  if (!there("out.exr")) {
    EXPECT_TRUE(there("out.exr.checkpoint"));
    const ProgramRun last = run_shoal(folder_, render({"--resume"}));
    expect_exit(last, 0);
    EXPECT_THAT(last.err, HasSubstr("going on from"));
  }
  expect_identical("out.exr", "whole.exr");
}

TEST_F(CheckpointProgram, WithoutOneResumeStartsAfreshAndWithoutResumeOneIsLeftAlone) {
  const ProgramRun afresh = run_shoal(folder_, render({"--resume"}, "1"));
  expect_exit(afresh, 0);
  EXPECT_THAT(afresh.err, HasSubstr("starts afresh"));
  expect_exit(stopped(render({}, kMany), SIGTERM, 0), 9);
  ASSERT_TRUE(there("out.exr.checkpoint"));
  expect_error(run_shoal(folder_, join(render({"--seed", "4", "--resume"}), {"--quiet"})), 3,
               {"out.exr.checkpoint", "seed is 0, not 4"});
  expect_error(run_shoal(folder_, join(render({"--resume"}, "5"), {"--quiet"})), 2, {kMany, "found 5"});
  EXPECT_TRUE(there("out.exr.checkpoint"));
  const ProgramRun without = run_shoal(folder_, render({}, "1"));
  expect_exit(without, 0);
  EXPECT_THAT(without.err, HasSubstr("--resume would go on from it"));
  EXPECT_FALSE(there("out.exr.checkpoint"));
  put_file(folder_ / "out.exr.checkpoint", "nothing");
  expect_error(run_shoal(folder_, join(render({"--resume"}, "1"), {"--quiet"})), 3, {"is no checkpoint"});
}

TEST_F(CheckpointProgram, NeverMeansNever) {
  const ProgramRun run = stopped(render({"--checkpoint", "never"}, kMany), SIGTERM, 0);
  expect_exit(run, 9);
  EXPECT_FALSE(there("out.exr.checkpoint"));
  for (const std::vector<std::string>& bad : {std::vector<std::string>{"--checkpoint", "often"},
                                              {"--checkpoint", "every=0"},
                                              {"--checkpoint", "every=10x"},
                                              {"--checkpoint", "never", "--resume"},
                                              {"--sample-range", "4"},
                                              {"--sample-range", "4:4"},
                                              {"--sample-range", "0:49"},
                                              {"--sample-range", "0:4", "--png", folder_ / "o.png"},
                                              {"--sample-range", "0:4", "--time-limit", "5"},
                                              {"--sample-range", "0:4", "--target-noise", "2%"}}) {
    const ProgramRun refused = run_shoal(folder_, join(render(bad), {"--quiet"}));
    expect_exit(refused, 2);
    EXPECT_NE(refused.err, "");
  }
}

TEST_F(CheckpointProgram, ASecondSignalEndsItAtOnce) {
  Program program(folder_, join({SHOAL_BINARY}, render({"--progress", "json"}, kMany)));
  while (program.running() && program.err().find("\"rendering\"") == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  program.send(SIGTERM);
  program.send(SIGTERM);  // the same, sent to a group and passed on
  const ProgramRun run = program.wait();
  expect_exit(run, 9);
  EXPECT_TRUE(there("out.exr.checkpoint")) << run.err;
}

TEST_F(CheckpointProgram, PartsAreMergedToTheSameBits) {
  expect_exit(run_shoal(folder_, join(render({"--png", folder_ / "whole.png"}, "48", "whole.exr"), {"--quiet"})),
              0);
  const auto part = [&](const std::string& range, const std::string& order) {
    return run_shoal(folder_,
                     render({"--quiet", "--sample-range", range, "--order", order}, "48", range + ".part"));
  };
  expect_exit(part("0:16", "queued"), 0);
  expect_exit(part("16:17", "sorted"), 0);
  expect_exit(part("17:48", "hybrid"), 0);
  const auto merge = [&](const std::vector<std::string>& parts) {
    std::vector<std::string> words = {"merge"};
    for (const std::string& name : parts) words.push_back(folder_ / (name + ".part"));
    return run_shoal(folder_, join(words, {"-o", folder_ / "merged.exr", "--png", folder_ / "merged.png"}));
  };
  const ProgramRun merged = merge({"17:48", "0:16", "16:17"});
  expect_exit(merged, 0);
  EXPECT_THAT(merged.err, HasSubstr("3 parts, 48 samples a pixel"));
  expect_identical("merged.exr", "whole.exr");
  EXPECT_EQ(file_text(folder_ / "merged.png"), file_text(folder_ / "whole.png"));
  expect_exit(merge({"17:48", "0:16"}), 3);
}

TEST(CheckpointBatch, OneThatIsStoppedGoesOnWithThePictureItWasAt) {
  const BatchFolder batch;
  const std::vector<std::string> options = {"--width",  "160",   "--height", "120",           "--include",
                                            "one.gltf", "--spp", "400",      "--environment", "constant:1,1,1"};
  const auto command = [&](const std::string& out) {
    return join({"batch", batch.scenes(), "--out", out}, options);
  };
  expect_exit(run_shoal(batch.folder, join(command(batch.folder / "whole"), {"--quiet"})), 0);
  bool resumed = false;
  for (int attempt = 0; attempt < 20 && !resumed; ++attempt) {
    stdfs::remove_all(batch.out());
    Program program(batch.folder, join({SHOAL_BINARY}, command(batch.out())));
    while (program.running() && program.err().find("begins") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(30 + 20 * attempt));
    program.send(SIGTERM);
    program.wait();
    resumed = stdfs::exists(batch.out("/one.exr.checkpoint"));
  }
  ASSERT_TRUE(resumed);
  expect_exit(run_shoal(batch.folder, {"batch", "--resume", "--out", batch.out(), "--quiet"}), 0);
  EXPECT_EQ(pictures_in(batch.out()), pictures_in(batch.folder / "whole"));
  EXPECT_FALSE(stdfs::exists(batch.out("/one.exr.checkpoint")));
  const auto stats = nlohmann::json::parse(file_text(batch.out("/one.stats.json")), nullptr, false);
  EXPECT_TRUE(stats["resumed_from"].is_object());
  // One of other options is of no use, and in nobody's way; nor is one that is damaged.
  put_file(batch.out("/one.exr.checkpoint"), "nothing");
  expect_exit(run_shoal(batch.folder, join(command(batch.out()), {"--quiet", "--", "--seed", "2"})), 0);
  EXPECT_FALSE(stdfs::exists(batch.out("/one.exr.checkpoint")));
}

}  // namespace
}  // namespace shoal::testing
