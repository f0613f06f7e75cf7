// shoal batch: every scene under a folder is done once, failures stay alone, what is done is skipped, and one budget is
// shared. What happens when it is killed: batch_kill_test.cpp.
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <regex>
#include <thread>

#include "tests/bins/batch_folder.h"
#include "tests/support/sanitized.h"

namespace shoal::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;
namespace stdfs = std::filesystem;

TEST(Batch, EverySceneIsRenderedAndSummedUp) {
  const BatchFolder batch;
  batch.add_scene("one.glb", 4, true);
  expect_exit(batch.run({"--effects=+textures"}), 0);
  EXPECT_THAT(batch.outputs(),
              ElementsAre("deep/er/three.exr", "deep/er/three.png", "deep/er/three.stats.json", "one.glb.exr", "one.glb.png",
                          "one.glb.stats.json", "one.gltf.exr", "one.gltf.png", "one.gltf.stats.json", "two words.exr",
                          "two words.png", "two words.stats.json"));
  const Json summary = batch.summary();
  EXPECT_EQ(summary["state"], "finished");
  EXPECT_EQ(summary["scenes_count"], 4);
  EXPECT_EQ(summary["done_count"], 4);
  EXPECT_EQ(summary["failed_count"], 0);
  const Json three = batch.entry("deep/er/three.gltf");
  EXPECT_EQ(three["state"], "done");
  EXPECT_EQ(three["exit_code"], 0);
  EXPECT_EQ(three["picture"], "deep/er/three.exr");
  EXPECT_EQ(three["width"], 24);
  EXPECT_EQ(three["samples_per_pixel"], 1);
  EXPECT_EQ(three["triangles_count"], 1);
  EXPECT_GT(three["rays_count"], 0);
  EXPECT_GT(three["peak_rss_bytes"], 0);
  EXPECT_GT(three["seconds"], 0);
  EXPECT_GE(three["seconds"], three["render_seconds"]);
  EXPECT_THAT(three["effects"].get<std::vector<std::string>>(), ::testing::Contains("textures"));
  const std::string page = file_text(batch.out("/summary.html"));
  EXPECT_THAT(page, HasSubstr("deep/er/three.gltf"));
  EXPECT_EQ(std::regex_replace(page, std::regex("data:image/png;base64,[A-Za-z0-9+/=]+"), "PICTURE").find("http"),
            std::string::npos);
  EXPECT_THAT(page, HasSubstr("data:image/png;base64,"));
  EXPECT_TRUE(stdfs::is_empty(batch.out("/.batch/built"))) << "what is built goes";
  // Each is what `render` alone gives.
  expect_exit(run_shoal(batch.folder, join(join({"render", batch.scenes() + "/one.glb", "-o", batch.folder / "x.exr"},
                                                {"--effects=+textures"}), tiny_picture())), 0);
  expect_exit(run_shoal(batch.folder, {"diff", batch.folder / "x.exr", batch.out("/one.glb.exr")}), 0);
}

TEST(Batch, AFailureStaysAloneAndIsTriedAgain) {
  const BatchFolder batch;
  put_file(batch.scenes() + "/deep/broken.gltf", "{\"asset\": ");
  for (int n = 0; n < 2; ++n) {
    const ProgramRun run = batch.run();
    expect_exit(run, 8);
    EXPECT_THAT(run.err, HasSubstr("deep/broken.gltf: failed (code 3)"));
    const Json broken = batch.entry("deep/broken.gltf");
    EXPECT_EQ(broken["state"], "failed");
    EXPECT_EQ(broken["exit_code"], 3);
    EXPECT_THAT(broken["message"].get<std::string>(), HasSubstr("expected JSON"));
    EXPECT_THAT(broken["message"].get<std::string>(), HasSubstr("broken.gltf"));
    EXPECT_EQ(batch.summary()["failed_count"], 1);
    EXPECT_EQ(batch.summary()[n == 0 ? "done_count" : "skipped_count"], 3);
  }
  batch.add_scene("deep/broken.gltf", 2);
  expect_exit(batch.run(), 0);
  EXPECT_EQ(batch.summary()["done_count"], 1);
}

TEST(Batch, WhatIsDoneIsSkippedUntilSomethingChanges) {
  const BatchFolder batch;
  expect_exit(batch.run(), 0);
  const auto expect_done = [&](const std::vector<std::string>& more, uint64_t done, const char* why) {
    expect_exit(batch.run(more), 0);
    EXPECT_EQ(batch.summary()["done_count"], done) << why;
    EXPECT_EQ(batch.summary()["skipped_count"], 3 - done) << why;
  };
  expect_done({}, 0, "nothing changed");
  EXPECT_EQ(batch.entry("one.gltf")["skipped"], true);
  EXPECT_EQ(batch.entry("one.gltf")["rays_count"].is_number(), true) << "figures are remembered";
  batch.add_scene("one.gltf", 2.5f);
  expect_done({}, 1, "another scene of that name");
  std::string bytes = file_text(batch.scenes() + "/buffer200.bin");
  bytes[4] = static_cast<char>(bytes[4] ^ 1);
  put_file(batch.scenes() + "/buffer200.bin", bytes);
  expect_done({}, 1, "a buffer of the same size");
  expect_done({"--seed", "9"}, 3, "an option");
  expect_done({"--seed", "9"}, 0, "the same option");
  put_file(batch.scenes() + "/shoal.json", R"({"scenes": {"one.gltf": {"bounces": 2}}})");
  expect_done({"--seed", "9"}, 1, "its own option");
  stdfs::remove(batch.out("/two words.png"));
  expect_done({"--seed", "9"}, 1, "a picture is gone");
  expect_done({"--seed", "9", "--max-memory", "300M", "--threads", "1"}, 0, "what does not change a picture");
  expect_done({"--seed", "9", "--force"}, 3, "--force");
  expect_done({"--seed", "9", "--", "--spp", "2"}, 3, "an option behind dashes");
  EXPECT_EQ(batch.entry("one.gltf")["samples_per_pixel"], 2);
}

TEST(Batch, ResumeKnowsWhatTheBatchWas) {
  const BatchFolder batch;
  expect_error(run_shoal(batch.folder, {"batch", "--resume", "--out", batch.out()}), 3, {"no batch is known"});
  expect_exit(batch.run({"--exclude", "deep", "--", "--seed=3"}), 0);
  const auto before = pictures_in(batch.out());
  EXPECT_EQ(before.size(), 2u);
  stdfs::remove(batch.out("/one.exr"));
  expect_exit(run_shoal(batch.folder, {"batch", "--resume", "--out", batch.out()}), 0);
  EXPECT_EQ(batch.summary()["done_count"], 1);
  EXPECT_EQ(batch.summary()["skipped_count"], 1);
  EXPECT_EQ(pictures_in(batch.out()), before);
  expect_error(run_shoal(batch.folder, {"batch", batch.folder.path(), "--resume", "--out", batch.out()}), 2,
               {"--resume", "is of"});
}

TEST(Batch, NamesMayBeAnyBytes) {
  const BatchFolder batch;
  const std::vector<std::string> names = {"-o.gltf", "it's \"$HOME\" `id`.gltf", "line\nbreak.gltf", "50%.gltf",
                                          "\xff\xfe.gltf", "<b>&.gltf", "deep\n/x.gltf"};
  for (const std::string& name : names) batch.add_scene(name, 1.5f);
  expect_exit(batch.run(), 0);
  EXPECT_EQ(batch.summary()["done_count"], 3 + names.size());
  for (const std::string& name : names) {
    EXPECT_TRUE(stdfs::exists(batch.out("/").append(name, 0, name.size() - 5) + ".exr")) << name;
  }
  EXPECT_EQ(batch.entry("line%0Abreak.gltf")["state"], "done");
  EXPECT_EQ(batch.entry("%FF%FE.gltf")["state"], "done");
  EXPECT_THAT(file_text(batch.out("/summary.html")), Not(HasSubstr("<b>")));
  expect_exit(batch.run(), 0);
  EXPECT_EQ(batch.summary()["skipped_count"], 3 + names.size());
  // Lines of a dry run say the same to a shell.
  const std::string lines = "\"$SHOAL\" batch scenes --out dry --dry-run --width 24 --height 16 --spp 1 > lines && ";
  expect_exit(run_shell(batch.folder, lines + "sh lines > log 2>&1"), 0);
  const std::string text = file_text(batch.folder / "lines");
  EXPECT_EQ(static_cast<size_t>(std::count(text.begin(), text.end(), '\n')), 3 + names.size());
  EXPECT_EQ(pictures_in(batch.folder / "dry"), pictures_in(batch.out()));
}

TEST(Batch, ADryRunWritesNothingAndLeavesOutWhatIsDone) {
  const BatchFolder batch;
  const ProgramRun lines = batch.run({"--dry-run"});
  expect_exit(lines, 0);
  EXPECT_EQ(std::count(lines.out.begin(), lines.out.end(), '\n'), 3);
  EXPECT_EQ(lines.out.find("--max-memory"), std::string::npos) << "each machine's own";
  EXPECT_FALSE(stdfs::exists(batch.out()));
  expect_exit(batch.run({"--exclude", "one.*"}), 0);
  const ProgramRun rest = batch.run({"--dry-run", "--jobs", "4", "--max-memory", "1G", "--threads", "8"});
  expect_exit(rest, 0);
  EXPECT_EQ(std::count(rest.out.begin(), rest.out.end(), '\n'), 1);
  EXPECT_THAT(rest.out, HasSubstr("one.gltf"));
  EXPECT_THAT(rest.out, HasSubstr("--max-memory 268435456 --threads 2"));
}

TEST(Batch, JobsShareOneBudget) {
  const BatchFolder batch;
  batch.add_scene("four.gltf", 4);
  constexpr uint64_t kAll = (kSanitized ? 4096ull : 256ull) << 20;
  const std::string all = std::to_string(kAll);
  const ProgramRun run = batch.run({"--jobs", "2", "--max-memory", all, "--threads", "4"});
  expect_exit(run, 0);
  for (const char* scene : {"deep/er/three.gltf", "four.gltf"}) {  // the first two begin together, whatever comes later
    const Json entry = batch.entry(scene);
    EXPECT_LT(entry["max_memory_bytes"].get<uint64_t>(), kAll / 2) << "the batch itself has its part";
    EXPECT_GT(entry["max_memory_bytes"].get<uint64_t>(), kAll / 4);
    EXPECT_EQ(entry["threads_count"], 2);
  }
  const Json summary = batch.summary();
  for (const Json& entry : summary["scenes"]) {
    EXPECT_LE(entry["peak_rss_bytes"].get<uint64_t>(), entry["max_memory_bytes"].get<uint64_t>());
  }
  // With one job a scene has everything; the picture is the same.
  const auto shared = pictures_in(batch.out());
  expect_exit(batch.run({"--max-memory", all, "--force"}), 0);
  EXPECT_GT(batch.entry("one.gltf")["max_memory_bytes"].get<uint64_t>(), kAll / 2);
  EXPECT_EQ(pictures_in(batch.out()), shared);
}

TEST(Batch, AShareThatIsTooSmallIsMadeUpForAlone) {
  if (kSanitized) GTEST_SKIP() << "the smallest cap of a process changes from run to run with a sanitizer";
  const BatchFolder batch;
  put_file(batch.scenes() + "/shoal.json", R"({"scenes": {"one.gltf": {"width": 1600, "height": 1000}}})");
  const ProgramRun refused = run_shoal(
      batch.folder, {"render", batch.scenes() + "/one.gltf", "-o", batch.folder / "x.exr", "--png", batch.folder / "x.png",
                     "--width", "1600", "--height", "1000", "--spp", "1", "--max-memory", "40M"});
  expect_exit(refused, 5);
  std::smatch match;
  ASSERT_TRUE(std::regex_search(refused.err, match, std::regex("about ([0-9]+) MiB"))) << refused.err;
  const int smallest = std::stoi(match[1]);
  ASSERT_GT(smallest, 50) << "of which half is too little, and the batch itself takes a part";
  const ProgramRun run = batch.run({"--jobs", "2", "--max-memory", std::to_string(smallest * 3 / 2) + "M"});
  expect_exit(run, 0);
  EXPECT_EQ(batch.entry("one.gltf")["alone"], true);
  EXPECT_EQ(batch.entry("two words.gltf")["alone"], false);
  const ProgramRun too_little = batch.run({"--jobs", "2", "--force", "--max-memory", std::to_string(smallest / 2 + 15) + "M"});
  expect_exit(too_little, 8);
  EXPECT_EQ(batch.entry("one.gltf")["exit_code"], 5);
  EXPECT_THAT(batch.entry("one.gltf")["message"].get<std::string>(), HasSubstr("the smallest that would"));
  EXPECT_EQ(batch.summary()["done_count"], 2);
  expect_error(batch.run({"--max-memory", "1M"}), 5, {"the batch itself takes"});
}

TEST(Batch, AWrongShoalJsonFailsItsFolderOnly) {
  const BatchFolder batch;
  put_file(batch.scenes() + "/shoal.json", R"({"scenes": {"one.gltf": {"sp": 4}}})");
  const ProgramRun run = batch.run();
  expect_exit(run, 8);
  EXPECT_EQ(batch.summary()["failed_count"], 2);
  EXPECT_EQ(batch.summary()["done_count"], 1);
  for (const char* scene : {"one.gltf", "two words.gltf"}) {
    const Json entry = batch.entry(scene);
    EXPECT_EQ(entry["exit_code"], 3);
    EXPECT_THAT(entry["message"].get<std::string>(), HasSubstr("shoal.json: scenes[\"one.gltf\"]: unknown key \"sp\""));
  }
  put_file(batch.scenes() + "/shoal.json", R"({"scenes": {"no.gltf": {}}})");
  EXPECT_THAT(batch.run().err, HasSubstr("scenes[\"no.gltf\"]: expected the name of a scene beside it"));
  put_file(batch.scenes() + "/shoal.json", R"({"defaults": {"width": "wide"}})");
  EXPECT_THAT(batch.run().err, HasSubstr("defaults[\"width\"]"));
  put_file(batch.scenes() + "/shoal.json", R"({"defaults": {"output": "/etc/passwd"}})");
  EXPECT_THAT(batch.run().err, HasSubstr("unknown key \"output\""));
  put_file(batch.scenes() + "/shoal.json", R"({"defaults": {"spp": 3}, "scenes": {"one.gltf": {"spp": 2}}})");
  expect_exit(batch.run(), 0);
  EXPECT_EQ(batch.entry("one.gltf")["samples_per_pixel"], 2);
  EXPECT_EQ(batch.entry("two words.gltf")["samples_per_pixel"], 3);
  EXPECT_EQ(batch.entry("deep/er/three.gltf")["samples_per_pixel"], 1) << "beside it only";
}

TEST(Batch, WhatCannotBeginIsSaid) {
  const BatchFolder batch;
  stdfs::create_directory(batch.folder / "empty");
  const auto refused = [&](const std::vector<std::string>& words, int code, const std::vector<std::string>& parts) {
    expect_error(run_shoal(batch.folder, join({"batch"}, words)), code, parts);
  };
  refused({"--out", batch.out()}, 2, {"folder of the scenes is missing"});
  refused({batch.scenes(), "--out", batch.scenes() + "/."}, 2, {"the folder of the scenes"});
  refused({batch.folder / "missing", "--out", batch.out()}, 3, {"missing", "No such file"});
  refused({batch.folder / "empty", "--out", batch.out()}, 3, {"expected scenes", "found none"});
  refused({batch.scenes(), "--out", batch.out(), "--include", "*.obj"}, 3, {"none that the patterns leave"});
  refused({batch.scenes(), "--out", batch.out(), "--include", "[a"}, 2, {"'[a' is not a pattern"});
  refused({batch.scenes(), "--out", batch.out(), "--max-memory", "much"}, 2, {"'much' is not a size"});
  refused({batch.scenes(), "--out", batch.out(), "--", "--png", "x"}, 2, {"'--png'"});
  refused({batch.scenes(), "--out", batch.out(), "--", "--spp", "many"}, 2, {"many"});
  expect_exit(run_shoal(batch.folder, {"batch", batch.scenes(), "--out", batch.out(), "--spp", "many"}), 2);
  expect_exit(run_shoal(batch.folder, {"batch", batch.scenes(), "--out", batch.out(), "--wide", "2"}), 2);
  put_file(batch.folder / "file", "");
  refused({batch.scenes(), "--out", batch.folder / "file"}, 6, {"file"});
  EXPECT_FALSE(stdfs::exists(batch.out()));
}

TEST(Batch, KeptScenesAreNotBuiltAgain) {
  const BatchFolder batch;
  expect_exit(batch.run({"--keep-built"}), 0);
  const auto built = [&] {
    size_t count = 0;
    for (const auto& entry : stdfs::recursive_directory_iterator(batch.out("/.batch/built"))) {
      count += entry.path().extension() == ".shoal";
    }
    return count;
  };
  EXPECT_EQ(built(), 3u);
  expect_exit(batch.run({"--keep-built", "--force"}), 0);
  EXPECT_EQ(built(), 3u);
  for (const auto& log : stdfs::directory_iterator(batch.out("/.batch/logs"))) {
    EXPECT_THAT(file_text(log.path().string()), Not(HasSubstr("building")));
  }
  batch.add_scene("one.gltf", 5);
  expect_exit(batch.run({"--keep-built"}), 0);
  EXPECT_EQ(built(), 3u) << "that of the scene before it changed is gone";
  expect_exit(batch.run(), 0);
  EXPECT_EQ(built(), 0u);
}

TEST(Batch, ARenderThatIsKilledHasFailed) {
  const BatchFolder batch;
  put_file(batch.scenes() + "/shoal.json", R"({"scenes": {"one.gltf": {"spp": 4000000}}})");
  const std::string kill_child =
      "true; \"$SHOAL\" batch scenes --out out --width 24 --height 16 --spp 1 --include '*.gltf' --exclude deep 2> log & batch=$!; "
      "until grep -q 'one.gltf: begins' log; do sleep 0.02; done; "
      "read child < /proc/$batch/task/$batch/children; kill -9 $child; wait $batch";
  expect_exit(run_shell(batch.folder, kill_child), 8);
  EXPECT_EQ(batch.entry("one.gltf")["exit_code"], 137);
  EXPECT_THAT(batch.entry("one.gltf")["message"].get<std::string>(), HasSubstr("ended by signal 9"));
  EXPECT_EQ(batch.entry("two words.gltf")["state"], "done");
  expect_no_temporaries(batch.out());
}

/// Waits until the file is there.
bool comes(const std::string& path) {
  for (int n = 0; n < 6000; ++n) {
    if (stdfs::exists(path)) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST(Batch, OnlyOneIsAtWorkAndItStopsWithItsRenders) {
  const BatchFolder batch;
  Program slow(batch.folder, join({SHOAL_BINARY}, batch.command({"--jobs", "2", "--", "--spp", "4000000"})));
  ASSERT_TRUE(comes(batch.out("/.batch/lock")));
  for (int n = 0; n < 6000 && slow.err().find("begins") == std::string::npos; ++n) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  expect_error(batch.run(), 6, {"is locked", "is at work there"});
  slow.send(SIGTERM);
  const ProgramRun stopped = slow.wait();
  expect_exit(stopped, 9);
  EXPECT_THAT(stopped.err, HasSubstr("stopped"));
  EXPECT_EQ(batch.summary()["state"], "stopped");
  EXPECT_EQ(batch.summary()["left_count"], 3);
  EXPECT_THAT(batch.outputs(), ::testing::Each(::testing::EndsWith(".exr.checkpoint")));
  expect_no_temporaries(batch.out());
  expect_exit(batch.run(), 0);
  EXPECT_EQ(batch.summary()["done_count"], 3);
  EXPECT_THAT(batch.outputs(), ::testing::Not(::testing::Contains(::testing::EndsWith(".checkpoint"))));
}

}  // namespace
}  // namespace shoal::testing
