// Bad luck on a real machine: disks too small, a scene cut short under a running render, a source that changed.
#include <sys/mount.h>

#include <filesystem>
#include <thread>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

/// A file system of its own, so small that it fills up; where that is not permitted, mounted() is false.
class SmallDisk {
 public:
  SmallDisk(const std::string& folder, const std::string& size) : folder_(folder) {
    std::filesystem::create_directory(folder_);
    mounted_ = ::mount("none", folder_.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool mounted() const { return mounted_; }

 private:
  const std::string folder_;
  bool mounted_ = false;
};

TEST(BadLuck, ADiskThatIsTooSmallEndsWithCodeSixAndNoFile) {
  const TemporaryFolder folder;
  make_terrain(folder, "20K");
  const SmallDisk disk(folder / "disk", "256K");
  if (!disk.mounted()) GTEST_SKIP() << "not permitted to mount a small disk";
  expect_error(run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / "disk/o.shoal", "--quiet"}),
               6, {"o.shoal", "disk full"});
  const auto render = [&](const std::vector<std::string>& outputs) {
    return join({"render", folder / "terrain.shoal", "--quiet", "--width", "400", "--height", "400", "--spp", "1"},
                outputs);
  };
  expect_error(run_shoal(folder, render({"-o", folder / "disk/o.exr"})), 6, {"o.exr", "disk full"});
  expect_error(run_shoal(folder, render({"-o", folder / "o.exr", "--png", folder / "disk/o.png"})), 6,
               {"o.png", "disk full"});
  EXPECT_TRUE(folder.names("disk").empty());
}

TEST(BadLuck, AScratchFolderThatCannotBeUsedIsNamed) {
  const TemporaryFolder folder;
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", "400K", "--out", folder / "terrain", "--quiet"}),
              0);
  const auto build = [&](const std::string& scratch) {
    return run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / "o.shoal", "--max-memory", "72M",
                              "--threads", "1", "--scratch", scratch, "--quiet"});
  };
  put_file(folder / "a-file", "x");
  for (const std::string& bad : {folder / "missing", folder / "a-file", std::string("/proc")}) {
    expect_error(build(bad), 6, {"scratch file of", bad});
  }
  const SmallDisk disk(folder / "disk", "1M");
  if (disk.mounted()) expect_error(build(folder / "disk"), 6, {"scratch file of", "disk full"});
  expect_exit(build(folder.path()), 0);
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("a-file", "disk", "o.shoal", "terrain"));
}

TEST(BadLuck, ASceneCutShortUnderARenderEndsIt) {
  const TemporaryFolder folder;
  make_terrain(folder, "50K");
  expect_exit(run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / "small-pages.shoal",
                                 "--treelet-size", "16K", "--quiet"}), 0);
  for (const std::string order : {"queued", "depth-first", "sorted"}) {
    std::filesystem::copy_file(folder / "small-pages.shoal", folder / "cut.shoal",
                               std::filesystem::copy_options::overwrite_existing);
    Program program(folder, {SHOAL_BINARY, "render", folder / "cut.shoal", "-o", folder / "o.exr", "--order", order,
                             "--width", "2000", "--height", "2000", "--spp", "64", "--progress", "lines",
                             "--page-cache", "512K", "--threads", "1"});
    while (program.running() && program.err().find("memory:") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::filesystem::resize_file(folder / "cut.shoal", 8192);
    const ProgramRun run = program.wait();
    expect_exit(run, 6);
    EXPECT_NE(run.err.find("cut.shoal"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("offset"), std::string::npos) << run.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "o.exr"));
  }
}

TEST(BadLuck, ASceneWhoseSourceChangedIsRefusedUnlessAsked) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const auto render = [&](const std::vector<std::string>& more) {
    return run_shoal(folder, join(join({"render", folder / "terrain.shoal", "-o", folder / "o.exr", "--quiet"},
                                       tiny_picture()), more));
  };
  expect_exit(render({}), 0);
  const std::string source = folder / "terrain/terrain.gltf", text = file_text(source);
  put_file(source, text + "\n");
  expect_error(render({}), 3, {"terrain.shoal is out of date", "terrain.gltf", "--allow-stale"});
  expect_error(run_shoal(folder, join({"compare", folder / "terrain.shoal", "--out", folder / "compared", "--quiet"},
                                      tiny_picture())), 3, {"out of date"});
  expect_exit(render({"--allow-stale"}), 0);
  put_file(source, text);
  expect_exit(render({}), 0);
  put_file(source, text + "\n");
  std::filesystem::rename(folder / "terrain", folder / "elsewhere");
  expect_exit(render({}), 0);
}

}  // namespace
}  // namespace shoal::testing
