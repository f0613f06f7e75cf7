// The table kind of ray x order, as users get it: --kinds of `shoal compare`.
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using nlohmann::json;

std::vector<std::string> compare(const TemporaryFolder& folder, const std::vector<std::string>& more) {
  return join(join({"compare", folder / "terrain.shoal", "--out", folder / "out", "--quiet", "--bounces", "2"}, more),
              tiny_picture());
}

TEST(CompareKinds, IsAJsonACsvAndATableThatSayTheSame) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run =
      run_shoal(folder, compare(folder, {"--orders", "queued,depth-first,sorted,hybrid", "--runs", "2", "--kinds", "all"}));
  expect_exit(run, 0);
  const json report = json::parse(file_text(folder / "out/compare.json"));
  const json& kinds = report["ray_kinds"];
  std::istringstream csv(file_text(folder / "out/kinds.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_THAT(line, HasSubstr("kind,bounce,order,rays_count,hits_count,seconds,million_rays_a_second"));
  std::set<std::string> names;
  for (const json& kind : kinds) {
    names.insert(kind["kind"]);
    EXPECT_EQ(kind["hits_identical"], true);
    EXPECT_EQ(kind["orders"].size(), 4u);
    for (const auto& [order, figures] : kind["orders"].items()) {
      EXPECT_EQ(figures["rays_count"], kind["rays_count"]);
      EXPECT_EQ(figures["run_seconds"].size(), 2u);
      EXPECT_GT(figures["million_rays_a_second"], 0.0);
      EXPECT_GT(figures["node_tests_a_ray"], 0.0);
      const double rays = kind["rays_count"];
      EXPECT_NEAR(figures["disk_bytes_a_ray"].get<double>() * rays, figures["disk_read_bytes"].get<double>(), 1);
    }
  }
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) EXPECT_THAT(run.out, HasSubstr(order));
  size_t lines = 0;
  for (; std::getline(csv, line); ++lines) {
    const std::string kind = kinds[lines / 4]["kind"];
    EXPECT_EQ(line.substr(0, kind.size() + 1), kind + ",");
  }
  EXPECT_EQ(lines, kinds.size() * 4);
  EXPECT_EQ(kinds[0]["kind"], "camera");
  EXPECT_EQ(kinds[0]["rays_count"], 24 * 16);
  EXPECT_TRUE(names.contains("diffuse")) << run.out;
  for (const std::string& name : names) EXPECT_THAT(run.out, HasSubstr("\n" + name));
}

TEST(CompareKinds, TracesThoseAskedForAndNoneWithout) {
  const TemporaryFolder folder;
  make_terrain(folder);
  expect_exit(run_shoal(folder, compare(folder, {"--kinds", "diffuse", "--kind-rays", "100", "--orders", "sorted"})), 0);
  const json kinds = json::parse(file_text(folder / "out/compare.json"))["ray_kinds"];
  ASSERT_FALSE(kinds.empty());
  for (const json& kind : kinds) {
    EXPECT_EQ(kind["kind"], "diffuse");
    EXPECT_EQ(kind["orders"].size(), 1u);
  }
  const ProgramRun without = run_shoal(folder, compare(folder, {"--orders", "sorted"}));
  expect_exit(without, 0);
  EXPECT_FALSE(json::parse(file_text(folder / "out/compare.json")).contains("ray_kinds"));
  EXPECT_THAT(without.out, Not(HasSubstr("kinds of rays")));
  expect_error(run_shoal(folder, compare(folder, {"--kinds", "diffuse,odd"})), 2, {"odd", "point-shadow"});
  expect_error(run_shoal(folder, compare(folder, {"--kinds", "all", "--kind-rays", "0"})), 2, {"--kind-rays"});
}

}  // namespace
}  // namespace shoal::testing
