// Exit code 5: a cap that cannot work is refused with the smallest that would, and that one works.
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

/// The number of MiB after `words`, which a refusal names; 0 when there is none.
uint64_t named_mib(const std::string& text, const std::string& words) {
  std::smatch match;
  return std::regex_search(text, match, std::regex(words + " ([0-9]+) MiB")) ? std::stoull(match[1].str()) : 0;
}

TEST(MemoryCap, TheSmallestCapThatIsNamedWorksAndHolds) {
  const TemporaryFolder folder;
  make_terrain(folder);
  for (const char* order : {"queued", "depth-first"}) {
    const std::vector<std::string> render = join({"render", folder / "terrain.shoal", "-o", folder / "out.exr",
                                                  "--stats", folder / "out.json", "--quiet", "--order", order},
                                                 tiny_picture());
    const ProgramRun refused = run_shoal(folder, join(render, {"--max-memory", "1M"}));
    expect_error(refused, 5, {"memory cap of 1 MiB cannot work", "the smallest that would is about"});
    EXPECT_THAT(folder.names(), ::testing::Not(::testing::Contains("out.exr")));
    const uint64_t mib = named_mib(refused.err, "about");
    ASSERT_GT(mib, 1u) << refused.err;
    expect_exit(run_shoal(folder, join(render, {"--max-memory", std::to_string(mib) + "M"})), 0);
    const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "out.json"), nullptr, false);
    ASSERT_TRUE(stats.is_object());
    EXPECT_EQ(stats["memory"]["cap_bytes"], mib << 20);
    EXPECT_LE(stats["memory"]["total_bytes"], stats["memory"]["cap_bytes"]);
    EXPECT_GT(stats["memory"]["peak_rss_bytes"], 0);
    EXPECT_LE(stats["memory"]["peak_rss_bytes"], stats["memory"]["cap_bytes"]);
    std::filesystem::remove(folder / "out.exr");
  }
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
  expect_exit(run_shoal(folder, join(render, {"-o", folder / "capped.exr", "--max-memory", "64M",
                                              "--rays-in-flight", "64", "--threads", "1"})),
              0);
  const ProgramRun diff = run_shoal(folder, {"diff", folder / "free.exr", folder / "capped.exr"});
  expect_exit(diff, 0);
  EXPECT_THAT(diff.out, ::testing::HasSubstr("identical"));
}

}  // namespace
}  // namespace shoal::testing
