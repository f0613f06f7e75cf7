// Exit code 5: a cap that cannot work is refused with the smallest that would, and that one works.
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/bins/small_scene.h"
#include "tests/support/sanitized.h"
#include "tests/support/textured_quads.h"

namespace shoal::testing {
namespace {

constexpr bool kResidentMemoryIsOurs = !kSanitized;

/// The number of MiB after `words`, which a refusal names; 0 when there is none.
uint64_t named_mib(const std::string& text, const std::string& words) {
  std::smatch match;
  return std::regex_search(text, match, std::regex(words + " ([0-9]+) MiB")) ? std::stoull(match[1].str()) : 0;
}

/// What `render` takes is refused with 1 MiB, and rendered with what the refusal names, which holds all the time.
void expect_smallest_works(const TemporaryFolder& folder, const std::vector<std::string>& render) {
  const std::vector<std::string> with_stats = join(render, {"-o", folder / "out.exr", "--stats", folder / "out.json"});
  const ProgramRun refused = run_shoal(folder, join(with_stats, {"--max-memory", "1M"}));
  expect_error(refused, 5, {"memory cap of 1 MiB cannot work", "the smallest that would is about"});
  EXPECT_THAT(folder.names(), ::testing::Not(::testing::Contains("out.exr")));
  const uint64_t mib = named_mib(refused.err, "about");
  ASSERT_GT(mib, 1u) << refused.err;
  expect_exit(run_shoal(folder, join(with_stats, {"--max-memory", std::to_string(mib) + "M"})), 0);
  const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "out.json"), nullptr, false);
  ASSERT_TRUE(stats.is_object());
  EXPECT_EQ(stats["memory"]["cap_bytes"], mib << 20);
  EXPECT_LE(stats["memory"]["total_bytes"], stats["memory"]["cap_bytes"]);
  EXPECT_GT(stats["memory"]["peak_rss_bytes"], 0);
  if (kResidentMemoryIsOurs) {
    EXPECT_LE(stats["memory"]["peak_rss_bytes"], stats["memory"]["cap_bytes"]);
  }
  std::filesystem::remove(folder / "out.exr");
}

/// In every order, on one thread and on two.
void expect_smallest_works_in_all_orders(const TemporaryFolder& folder, const std::vector<std::string>& render) {
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid", "packet", "stream", "auto"}) {
    for (const char* threads : {"1", "2"}) {
      SCOPED_TRACE(std::string(order) + ", threads: " + threads);
      expect_smallest_works(folder, join(render, {"--quiet", "--order", order, "--threads", threads}));
    }
  }
}

/// A flat Radiance picture of one colour.
void put_environment(const std::string& path, uint32_t width, uint32_t height) {
  std::string text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(height) + " +X " +
                     std::to_string(width) + "\n";
  for (uint64_t i = 0; i < uint64_t{width} * height; ++i) text += std::string("\x80\x70\x60\x81", 4);
  put_file(path, text);
}

TEST(MemoryCap, TheSmallestCapThatIsNamedWorksAndHolds) {
  const TemporaryFolder folder;
  make_terrain(folder, "100K");
  expect_smallest_works_in_all_orders(folder, join({"render", folder / "terrain.shoal"}, tiny_picture()));
}

TEST(MemoryCap, TheSmallestCapWorksForAPictureThatOutweighsTheScene) {
  const TemporaryFolder folder;
  make_terrain(folder);
  // 57 MB of film and picture: what writing takes beside it would show.
  expect_smallest_works(folder, {"render", folder / "terrain.shoal", "--width", "1000", "--height", "800", "--spp", "1",
                                 "--bounces", "1", "--threads", "2", "--quiet", "--png", folder / "out.png"});
  expect_smallest_works(folder, {"render", folder / "terrain.shoal", "--width", "1000", "--height", "800", "--spp", "1",
                                 "--bounces", "1", "--threads", "2", "--quiet", "--preview", folder / "out.png"});
}

TEST(MemoryCap, TheSmallestCapWorksForAnEnvironmentThatOutweighsTheScene) {
  const TemporaryFolder folder;
  make_terrain(folder);
  put_environment(folder / "sky.hdr", 2048, 1024);  // 42 MB with its distribution
  expect_smallest_works_in_all_orders(
      folder, join({"render", folder / "terrain.shoal", "--environment", folder / "sky.hdr"}, tiny_picture()));
}

TEST(MemoryCap, TheSmallestCapWorksForASceneWithoutLight) {
  // What lights it is found by probes, which plan memory on their own.
  const TemporaryFolder folder;
  save(one_triangle(), folder / "dark");
  expect_exit(run_shoal(folder, {"build", folder / "dark/scene.gltf", "-o", folder / "dark.shoal"}), 0);
  expect_smallest_works_in_all_orders(
      folder, {"render", folder / "dark.shoal", "--width", "200", "--height", "100", "--spp", "4"});
}

TEST(MemoryCap, TheSmallestCapWorksForManyInstancesAndLights) {
  const TemporaryFolder folder;
  expect_exit(run_shoal(folder, {"generate", "demo", "--triangles", "5K", "--out", folder / "demo"}), 0);
  expect_exit(run_shoal(folder, {"build", folder / "demo/demo.gltf", "-o", folder / "demo.shoal"}), 0);
  expect_smallest_works_in_all_orders(folder, join({"render", folder / "demo.shoal"}, tiny_picture()));
}

TEST(MemoryCap, TheSmallestCapWorksForComparing) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::vector<std::string> compare = {"compare", folder / "terrain.shoal", "--out", folder / "out", "--quiet",
                                            "--width", "300", "--height", "200", "--spp", "1"};
  const ProgramRun refused = run_shoal(folder, join(compare, {"--max-memory", "1M"}));
  expect_error(refused, 5, {"the smallest that would is about"});
  const uint64_t mib = named_mib(refused.err, "about");
  expect_exit(run_shoal(folder, join(compare, {"--max-memory", std::to_string(mib) + "M"})), 0);
}

TEST(MemoryCap, TheSmallestCapWorksOnRealScenes) {
  const char* data = std::getenv("SHOAL_DATA");
  if (data == nullptr) GTEST_SKIP() << "SHOAL_DATA is not set: no real scenes";
  const TemporaryFolder folder;
  for (const std::string name : {"coffee", "lamp", "kitchen"}) {
    SCOPED_TRACE(name);
    const std::string gltf = std::string(data) + "/scenes/" + name + "/" + name + ".gltf";
    expect_exit(run_shoal(folder, {"build", gltf, "-o", folder / "real.shoal", "--quiet"}), 0);
    expect_smallest_works_in_all_orders(folder, join({"render", folder / "real.shoal"}, tiny_picture()));
    std::filesystem::remove(folder / "real.shoal");
  }
}

TEST(MemoryCap, TexturesThatDoNotFitChangeNothing) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer alone takes more than the cap";
  const TemporaryFolder folder;
  MemoryFileSystem images;
  const WrittenScene scene = textured_quads(images, 2, 2048);
  save(scene, folder / "wall");
  for (const std::string& name : images.names()) {
    const std::vector<std::byte> bytes = images.contents(name);
    put_file(folder / ("wall/" + name), {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  expect_exit(run_shoal(folder, {"build", folder / "wall/scene.gltf", "-o", folder / "wall.shoal"}), 0);
  const std::vector<std::string> render = {"render", folder / "wall.shoal", "--quiet", "--width", "96", "--height", "48",
                                           "--spp", "1", "--bounces", "1", "--environment", "constant:1,1,1",
                                           "--texture-filter", "bilinear",  // wants every tile
                                           "--stats", folder / "out.json"};
  expect_exit(run_shoal(folder, join(render, {"-o", folder / "free.exr"})), 0);
  expect_exit(run_shoal(folder, join(render, {"-o", folder / "capped.exr", "--max-memory", "24M"})), 0);
  const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "out.json"), nullptr, false);
  ASSERT_TRUE(stats.is_object());
  EXPECT_GT(stats["memory"]["texture_page_bytes"], 24 << 20) << "all tiles together do not even fit the cap";
  if (kResidentMemoryIsOurs) {
    EXPECT_LE(stats["memory"]["peak_rss_bytes"], 24 << 20);
  }
  EXPECT_GT(stats["counters"]["totals"]["page_evictions_count"], 0);
  expect_exit(run_shoal(folder, {"diff", folder / "free.exr", folder / "capped.exr"}), 0);
}

TEST(MemoryCap, BuildingNamesTheSmallestCapAndItWorks) {
  const TemporaryFolder folder;
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", "20K", "--out", folder / "terrain"}), 0);
  const std::vector<std::string> build = {"build", folder / "terrain/terrain.gltf", "-o", folder / "out.shoal"};
  const ProgramRun refused = run_shoal(folder, join(build, {"--quiet", "--max-memory", "1M"}));
  expect_error(refused, 5, {"terrain.gltf", "building needs", "the memory cap is 1 MiB"});
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("terrain"));
  const uint64_t mib = named_mib(refused.err, "building needs");
  ASSERT_GT(mib, 1u) << refused.err;
  expect_exit(run_shoal(folder, join(build, {"--quiet", "--max-memory", std::to_string(mib) + "M"})), 0);
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("out.shoal", "terrain"));
}

TEST(MemoryCap, APageCacheThatIsTooSmallNamesTheSmallest) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::vector<std::string> render =
      join({"render", folder / "terrain.shoal", "-o", folder / "out.exr", "--quiet"}, tiny_picture());
  const ProgramRun refused = run_shoal(folder, join(render, {"--page-cache", "4K"}));
  expect_error(refused, 5, {"page cache of 4096 bytes", "the smallest that works is"});
  std::smatch match;
  ASSERT_TRUE(std::regex_search(refused.err, match, std::regex("works is ([0-9]+) bytes"))) << refused.err;
  expect_exit(run_shoal(folder, join(render, {"--page-cache", match[1].str()})), 0);
}

TEST(MemoryCap, DoesNotChangeThePicture) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::vector<std::string> render = join({"render", folder / "terrain.shoal", "--quiet"}, tiny_picture());
  expect_exit(run_shoal(folder, join(render, {"-o", folder / "free.exr"})), 0);
  expect_exit(run_shoal(folder, join(render, {"-o", folder / "capped.exr", "--max-memory", kSanitized ? "1G" : "64M",
                                              "--rays-in-flight", "64", "--threads", "1"})),
              0);
  const ProgramRun diff = run_shoal(folder, {"diff", folder / "free.exr", folder / "capped.exr"});
  expect_exit(diff, 0);
  EXPECT_THAT(diff.out, ::testing::HasSubstr("identical"));
}

}  // namespace
}  // namespace shoal::testing
