// Exit codes 6 and 9: outputs appear whole or not at all, whatever stops them. Devices are stood in for by pipes in
// a folder of the test's own.
#include <signal.h>
#include <sys/stat.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/image.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

std::vector<std::string> render(const TemporaryFolder& folder, const std::vector<std::string>& outputs) {
  return join(join({"render", folder / "terrain.shoal", "--quiet"}, outputs), tiny_picture());
}

TEST(Output, FoldersThatAreMissingAreNamed) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const std::vector<std::string> good = {"-o", folder / "out.exr"};
  const std::string missing = folder / "missing/out";
  expect_error(run_shoal(folder, render(folder, {"-o", missing + ".exr"})), 6, {"missing/out.exr", "No such file"});
  expect_error(run_shoal(folder, render(folder, join(good, {"--png", missing + ".png"}))), 6, {"missing/out.png"});
  expect_error(run_shoal(folder, render(folder, join(good, {"--preview", missing + ".png"}))), 6, {"missing/out.png"});
  expect_error(run_shoal(folder, render(folder, join(good, {"--stats", missing + ".json"}))), 6,
               {"missing/out.json"});
  expect_error(run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", missing + ".shoal"}), 6,
               {"missing/out.shoal"});
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("terrain", "terrain.shoal"));
}

TEST(Output, OnlyAFileIsReplaced) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  std::filesystem::create_directory(folder / "folder.exr");
  ASSERT_EQ(::mkfifo((folder / "pipe.exr").c_str(), 0600), 0);
  expect_error(run_shoal(folder, render(folder, {"-o", folder / "folder.exr"})), 6,
               {"folder.exr", "found a folder"});
  expect_error(run_shoal(folder, render(folder, {"-o", folder / "pipe.exr"})), 6, {"pipe.exr", "found a device"});
  expect_error(run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / "pipe.exr"}), 6,
               {"pipe.exr", "found a device"});
  EXPECT_TRUE(std::filesystem::is_fifo(folder / "pipe.exr"));
  expect_exit(run_shoal(folder, render(folder, {"-o", folder / "out.exr"})), 0);
  const std::string first = file_text(folder / "out.exr");
  expect_exit(run_shoal(folder, render(folder, {"-o", folder / "out.exr", "--seed", "7"})), 0);
  EXPECT_NE(file_text(folder / "out.exr"), first);
}

TEST(Output, ADiskThatFillsUpEndsWithCodeSixAndNoFile) {
  const TemporaryFolder folder;
  make_terrain(folder, "2K");
  // A limit on the size of files stands in for a full disk.
  const std::string limited = "ulimit -f 4 && exec \"$SHOAL\" ";
  expect_error(
      run_shell(folder, limited + "render terrain.shoal -o out.exr --width 64 --height 64 --spp 1 --quiet"), 6,
      {"out.exr"});
  expect_error(run_shell(folder, limited + "build terrain/terrain.gltf -o out.shoal --quiet"), 6, {"out.shoal"});
  expect_error(run_shell(folder, limited + "generate terrain --triangles 20K --out more --quiet"), 6, {"more/"});
  EXPECT_THAT(folder.names(), ::testing::Not(::testing::Contains(::testing::HasSubstr("out."))));
}

TEST(Output, APictureThatWasThereStaysWhenARenderFails) {
  const TemporaryFolder folder;
  put_file(folder / "out.exr", "an older picture");
  expect_error(run_shoal(folder, {"render", folder / "missing.shoal", "-o", folder / "out.exr"}), 3,
               {"missing.shoal"});
  EXPECT_EQ(file_text(folder / "out.exr"), "an older picture");
}

TEST(Output, APreviewEndsAsTheFinishedPicture) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid", "auto"}) {
    expect_exit(run_shoal(folder, render(folder, {"-o", folder / "out.exr", "--png", folder / "out.png", "--preview",
                                                  folder / "preview.png", "--stats", folder / "out.json", "--exposure",
                                                  "1.5", "--order", order})),
                0);
    EXPECT_EQ(file_text(folder / "preview.png"), file_text(folder / "out.png"));
    const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "out.json"), nullptr, false);
    EXPECT_GT(stats["first_picture_seconds"], 0);
    EXPECT_LE(stats["first_picture_seconds"], stats["render_seconds"]);
    EXPECT_GT(stats["first_picture_pixel_share"], 0);
    EXPECT_GE(stats["previews_count"], 1);
    EXPECT_GT(stats["memory"]["preview_bytes"], 0);
    std::filesystem::remove(folder / "preview.png");
  }
  expect_exit(run_shoal(folder, render(folder, {"-o", folder / "out.exr", "--stats", folder / "out.json"})), 0);
  const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "out.json"), nullptr, false);
  EXPECT_TRUE(stats["first_picture_seconds"].is_null());
  EXPECT_TRUE(stats["first_picture_pixel_share"].is_null());
  EXPECT_EQ(stats["memory"]["preview_bytes"], 0);
}

TEST(Output, APreviewStaysWhenARenderIsStopped) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid", "auto"}) {
    Program program(folder, {SHOAL_BINARY, "render", folder / "terrain.shoal", "-o", folder / "out.exr", "--preview",
                             folder / "preview.png", "--width", "512", "--height", "512", "--spp", "100000",
                             "--quiet", "--order", order});
    while (program.running() && !std::filesystem::exists(folder / "preview.png")) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    program.send(SIGINT);
    expect_exit(program.wait(std::chrono::seconds(60)), 9);
    const std::string png = file_text(folder / "preview.png");
    const auto preview = decode_image(std::as_bytes(std::span(png)), "preview.png", 1 << 20);
    ASSERT_TRUE(preview.ok()) << preview.error().message;
    EXPECT_EQ(preview.value().width, 512u);
    EXPECT_THAT(folder.names(),
                ::testing::ElementsAre("out.exr.checkpoint", "preview.png", "terrain", "terrain.shoal"));
    std::filesystem::remove(folder / "preview.png");
  }
}

TEST(Output, SignalsStopARenderWithCodeNineAndNoFileButItsCheckpoint) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid", "auto"}) {
    for (const int signal : {SIGTERM, SIGINT}) {
      Program program(folder, {SHOAL_BINARY, "render", folder / "terrain.shoal", "-o", folder / "out.exr", "--png",
                               folder / "out.png", "--width", "512", "--height", "512", "--spp", "100000",
                               "--progress", "json", "--order", order});
      while (program.running() && program.err().find("\"rendering\"") == std::string::npos) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      program.send(signal);
      const ProgramRun run = program.wait(std::chrono::seconds(60));
      expect_exit(run, 9);
      EXPECT_THAT(run.err, ::testing::HasSubstr("the render was stopped"));
    }
  }
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("out.exr.checkpoint", "terrain", "terrain.shoal"));
}

}  // namespace
}  // namespace shoal::testing
