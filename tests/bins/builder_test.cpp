// --builder of `build`, `render` and `info`, as a user meets it.
#include <nlohmann/json.hpp>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

ProgramRun render_with(const TemporaryFolder& folder, const std::string& scene, const std::string& picture,
                       const std::vector<std::string>& options) {
  return run_shoal(
      folder, join(join({"render", scene, "-o", folder / picture, "--cache-dir", folder / "cache"}, tiny_picture()),
                   options));
}

TEST(Builder, IsKeptByTheFileAndGivesTheSamePicture) {
  const TemporaryFolder folder;
  make_terrain(folder, "5K");
  const std::string gltf = folder / "terrain/terrain.gltf";
  expect_exit(render_with(folder, folder / "terrain.shoal", "sah.exr", {"--builder", "sah"}), 0);
  double cost[2];
  int i = 0;
  for (const std::string name : {"lbvh", "karras"}) {
    const std::string shoal = folder / (name + ".shoal");
    expect_exit(run_shoal(folder, {"build", gltf, "-o", shoal, "--builder", name}), 0);
    expect_exit(render_with(folder, shoal, name + ".exr", {}), 0);
    expect_exit(run_shoal(folder, {"diff", folder / "sah.exr", folder / (name + ".exr")}), 0);
    expect_error(render_with(folder, shoal, "x.exr", {"--builder", "sah"}), 2,
                 {name + ".shoal", "was built with --builder " + name});
    EXPECT_THAT(run_shoal(folder, {"info", shoal}).out, HasSubstr("builder               " + name + ", SAH cost "));
    const json info = json::parse(run_shoal(folder, {"info", shoal, "--json"}).out);
    EXPECT_EQ(info["builder"], name);
    EXPECT_EQ(info["build"]["options"]["builder"], name);
    cost[i++] = info["build"]["sah_cost"];
  }
  EXPECT_LT(cost[1], cost[0]);
}

TEST(Builder, HasACachedSceneOfItsOwn) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "scene");
  const std::string gltf = folder / "scene/scene.gltf";
  expect_exit(render_with(folder, gltf, "a.exr", {}), 0);
  expect_exit(render_with(folder, gltf, "b.exr", {"--builder", "sah"}), 0);
  EXPECT_EQ(folder.names("cache").size(), 1u);
  expect_exit(render_with(folder, gltf, "c.exr", {"--builder", "lbvh"}), 0);
  EXPECT_EQ(folder.names("cache").size(), 2u);
  expect_exit(run_shoal(folder, {"diff", folder / "a.exr", folder / "c.exr"}), 0);
}

TEST(Builder, IsRefusedByNameWhereItIsUnknown) {
  const TemporaryFolder folder;
  for (const char* command : {"build", "render"}) {
    const ProgramRun run = run_shoal(folder, {command, "x.gltf", "-o", folder / "y", "--builder", "morton"});
    expect_exit(run, 2);
    EXPECT_THAT(run.err, HasSubstr("expected sah, lbvh or karras"));
  }
}

TEST(Builder, IsComparedByOrders) {
  const TemporaryFolder folder;
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", "3K", "--out", folder / "terrain"}), 0);
  const std::string gltf = folder / "terrain/terrain.gltf";
  const auto compare = [&](const std::string& scene, const std::vector<std::string>& options) {
    return run_shoal(folder, join(join({"compare", scene, "--orders", "queued,depth-first", "--out", folder / "out",
                                        "--cache-dir", folder / "cache"},
                                       tiny_picture()),
                                  options));
  };
  const ProgramRun run = compare(gltf, {"--builders", "sah,karras", "--runs", "2"});
  expect_exit(run, 0);
  EXPECT_THAT(run.out, HasSubstr("karras/queued"));
  const json report = json::parse(file_text(folder / "out/compare.json"));
  EXPECT_EQ(report["pictures_identical"], true);
  ASSERT_EQ(report["orders"].size(), 4u);
  for (const std::string builder : {"sah", "karras"}) {
    for (const std::string order : {"queued", "depth-first"}) {
      const json& stats = report["orders"][builder + "/" + order];
      EXPECT_EQ(stats["scene"]["builder"], builder);
      EXPECT_EQ(stats["run_seconds"].size(), 2u);
    }
  }
  EXPECT_EQ(folder.names("cache").size(), 2u);
  expect_error(compare(gltf, {"--builders", "sah,morton"}), 2, {"expected sah, lbvh or karras"});
  expect_error(compare(gltf, {"--builders", "lbvh", "--builder", "sah"}), 2, {"--builder and --builders"});
  expect_error(compare(folder / "x.shoal", {"--builders", "lbvh"}), 2, {"--builders is of a .gltf"});
}

TEST(Builder, StaysUnderTheCap) {
  const TemporaryFolder folder;
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", "400K", "--out", folder / "terrain"}), 0);
  for (const std::string name : {"sah", "karras"}) {
    const ProgramRun run =
        run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / (name + ".shoal"), "--builder",
                           name, "--max-memory", "64M"});
    expect_exit(run, 0);
    EXPECT_THAT(run.err, HasSubstr("built out of core in "));
    expect_exit(render_with(folder, folder / (name + ".shoal"), name + ".exr", {}), 0);
  }
  expect_exit(run_shoal(folder, {"diff", folder / "sah.exr", folder / "karras.exr"}), 0);
}

}  // namespace
}  // namespace shoal::testing
