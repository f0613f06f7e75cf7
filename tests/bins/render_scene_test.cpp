// A scene from generation to picture, as a user would go.
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/image.h"
#include "tests/bins/small_scene.h"
#include "tests/support/sanitized.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr uint64_t kMaxPixels = 1 << 20;
constexpr uint64_t kCapMiB = kSanitized ? 256 : 64;
constexpr const char* kCapLine = kSanitized ? "memory: cap 256 MiB" : "memory: cap 64.0 MiB";

ExrImage read_picture(const std::string& path) {
  auto image = read_exr(posix_file_system(), path, kMaxPixels);
  if (!image.ok()) ADD_FAILURE() << image.error().message;
  return image.ok() ? std::move(image).value() : ExrImage{};
}

json parsed(const std::string& text) {
  json value = json::parse(text, nullptr, false);
  EXPECT_FALSE(value.is_discarded()) << text.substr(0, 500);
  return value;
}

void expect_keys(const json& object, const std::vector<std::string>& keys) {
  for (const std::string& key : keys) EXPECT_TRUE(object.contains(key)) << key;
}

void expect_picture(const ExrImage& image, uint32_t width, uint32_t height, float samples) {
  EXPECT_EQ(image.width, width);
  EXPECT_EQ(image.height, height);
  std::vector<std::string> names;
  for (const ExrChannel& channel : image.channels) names.push_back(channel.name);
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("R", "G", "B", "A"));
  ASSERT_TRUE(image.text.contains("software"));
  EXPECT_THAT(image.text.at("software"), ::testing::StartsWith("Shoal "));
  ASSERT_TRUE(image.numbers.contains("samplesPerPixel") && image.numbers.contains("renderTimeSeconds"));
  EXPECT_EQ(image.numbers.at("samplesPerPixel"), samples);
  EXPECT_GT(image.numbers.at("renderTimeSeconds"), 0);
  EXPECT_TRUE(image.matrices.contains("worldToCamera") && image.matrices.contains("worldToNDC"));
}

void expect_stats(const json& stats, uint64_t samples) {
  expect_keys(stats, {"schema_version", "program", "options", "machine", "scene", "memory", "render_seconds",
                      "threads_count", "rays_per_second", "counters", "counter_list"});
  if (::testing::Test::HasFailure()) return;
  EXPECT_EQ(stats["schema_version"], 1);
  expect_keys(stats["options"], {"width", "height", "samples_per_pixel", "camera", "bounces", "seed", "order",
                                 "policy", "eviction", "read_depth", "rays_ahead", "state_levels", "max_memory_bytes"});
  EXPECT_FALSE(stats["options"]["environment"].get<std::string>().empty());
  EXPECT_FALSE(stats["options"]["buffered_reads"].get<bool>());
  EXPECT_THAT(stats["options"]["read_backend"].get<std::string>(), ::testing::AnyOf("io_uring", "threads", "none"));
  expect_keys(stats["machine"], {"cpu", "hardware_threads_count", "memory_limit_bytes", "system", "compiler"});
  expect_keys(stats["scene"], {"file", "file_bytes", "triangles_count", "treelets_count", "instances_count"});
  expect_keys(stats["counters"], {"totals", "by_kind", "by_bounce"});
  for (const json& counter : stats["counter_list"]) {
    expect_keys(counter, {"name", "unit", "meaning"});
    EXPECT_TRUE(stats["counters"]["totals"].contains(counter["name"].get<std::string>())) << counter;
  }
  const json& totals = stats["counters"]["totals"];
  EXPECT_EQ(totals["samples_committed_count"], samples);
  EXPECT_EQ(totals["page_requests_count"],
            totals["page_hits_count"].get<uint64_t>() + totals["page_misses_count"].get<uint64_t>());
  uint64_t traced = 0;
  for (const json& bounce : stats["counters"]["by_bounce"]) traced += bounce["rays_traced_count"].get<uint64_t>();
  EXPECT_EQ(totals["rays_traced_count"], traced);
  EXPECT_EQ(stats["counters"]["by_kind"]["camera"]["rays_traced_count"], samples);
}

TEST(RenderScene, GeneratedTerrainGoesFromTrianglesToPicture) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::string scene = folder / "terrain.shoal";
  const ProgramRun info = run_shoal(folder, {"info", scene});
  expect_exit(info, 0);
  EXPECT_THAT(info.out, HasSubstr("20000 stored"));
  const ProgramRun info_json = run_shoal(folder, {"info", scene, "--json"});
  expect_exit(info_json, 0);
  const json description = parsed(info_json.out);
  EXPECT_EQ(description["triangles_count"], 20000);
  EXPECT_EQ(description["file_bytes"], std::filesystem::file_size(scene));
  const ProgramRun verify = run_shoal(folder, {"verify", scene});
  expect_exit(verify, 0);
  EXPECT_THAT(verify.out, HasSubstr("as it was written"));

  const ProgramRun render =
      run_shoal(folder, {"render", scene, "-o", folder / "out.exr", "--png", folder / "out.png", "--stats",
                         folder / "out.json", "--width", "40", "--height", "30", "--spp", "2", "--max-memory",
                         fmt::format("{}M", kCapMiB)});
  expect_exit(render, 0);
  EXPECT_THAT(render.out, HasSubstr("read from disk"));
  EXPECT_THAT(render.err, HasSubstr(kCapLine));
  expect_picture(read_picture(folder / "out.exr"), 40, 30, 2);
  const std::string png = file_text(folder / "out.png");
  const auto preview = decode_image(std::as_bytes(std::span(png)), "out.png", kMaxPixels);
  ASSERT_TRUE(preview.ok());
  EXPECT_EQ(preview.value().width, 40u);
  EXPECT_EQ(preview.value().height, 30u);
  const json stats = parsed(file_text(folder / "out.json"));
  expect_stats(stats, 40 * 30 * 2);
  EXPECT_EQ(stats["memory"]["cap_bytes"], kCapMiB << 20);
  EXPECT_LE(stats["memory"]["peak_rss_bytes"], kCapMiB << 20);
  EXPECT_GT(stats["memory"]["peak_rss_bytes"], 1u << 20);
}

TEST(RenderScene, TheOrderIsChosenUnlessItIsNamedAndSaysWhy) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::vector<std::string> render = join({"render", folder / "terrain.shoal", "-o", folder / "out.exr", "--stats",
                                                folder / "out.json"}, tiny_picture());
  const ProgramRun chosen = run_shoal(folder, render);
  expect_exit(chosen, 0);
  EXPECT_THAT(chosen.err, HasSubstr("order: hybrid (a small scene in memory, too few samples to try others)"));
  json options = parsed(file_text(folder / "out.json"))["options"];
  EXPECT_EQ(options["order"], "hybrid");
  EXPECT_EQ(options["order_asked"], "auto");
  EXPECT_EQ(options["order_reason"], "a small scene in memory, too few samples to try others");
  const ProgramRun named = run_shoal(folder, join(render, {"--order", "sorted"}));
  expect_exit(named, 0);
  EXPECT_THAT(named.err, ::testing::Not(HasSubstr("order:")));
  options = parsed(file_text(folder / "out.json"))["options"];
  EXPECT_EQ(options["order"], "sorted");
  EXPECT_EQ(options["order_asked"], "sorted");
  EXPECT_EQ(options["order_reason"], "asked for");
}

TEST(RenderScene, ATimeLimitSaysHowManySamplesItHadTimeFor) {
  const TemporaryFolder folder;
  make_terrain(folder, "2K");
  const std::vector<std::string> options = {"render", folder / "terrain.shoal", "--width", "24", "--height", "16"};
  const ProgramRun limited = run_shoal(folder, join(options, {"-o", folder / "limited.exr", "--time-limit", "0.5",
                                                              "--stats", folder / "out.json"}));
  expect_exit(limited, 0);
  const json stats = parsed(file_text(folder / "out.json"));
  const uint64_t samples = stats["samples"]["most"];
  EXPECT_EQ(stats["options"]["time_limit_seconds"], 0.5);
  EXPECT_EQ(stats["samples"]["least"], samples);
  EXPECT_EQ(stats["samples"]["mean"], static_cast<double>(samples));
  EXPECT_GE(stats["samples"]["passes_count"], 1);
  EXPECT_THAT(limited.err, HasSubstr(fmt::format("{} samples a pixel in ", samples)));
  EXPECT_EQ(read_picture(folder / "limited.exr").numbers.at("samplesPerPixel"), static_cast<float>(samples));
  const ProgramRun most = run_shoal(folder, join(options, {"-o", folder / "few.exr", "--time-limit", "1000", "--spp", "3"}));
  expect_exit(most, 0);
  EXPECT_THAT(most.err, HasSubstr("3 samples a pixel in 2 passes"));
  expect_exit(run_shoal(folder, join(options, {"-o", folder / "asked.exr", "--spp", std::to_string(samples)})), 0);
  expect_exit(run_shoal(folder, {"diff", folder / "limited.exr", folder / "asked.exr"}), 0);
}

TEST(RenderScene, ATargetForNoiseSaysWhatItTookAndWhetherItWasMet) {
  const TemporaryFolder folder;
  make_terrain(folder, "2K");
  const std::vector<std::string> options = {"render", folder / "terrain.shoal", "--width", "24", "--height", "16", "-o",
                                            folder / "out.exr", "--stats", folder / "out.json", "--max-memory",
                                            fmt::format("{}M", kCapMiB)};
  const ProgramRun met = run_shoal(folder, join(options, {"--target-noise", "20%:50%"}));
  expect_exit(met, 0);
  EXPECT_THAT(met.err, HasSubstr(", noise "));
  EXPECT_THAT(met.err, HasSubstr(" % at the 95th percentile"));
  EXPECT_THAT(met.err, ::testing::Not(HasSubstr("was not reached")));
  json stats = parsed(file_text(folder / "out.json"));
  EXPECT_EQ(stats["options"]["samples_per_pixel"], 4096);
  EXPECT_FLOAT_EQ(stats["options"]["target_noise_percentile_95"].get<float>(), 0.5f);
  EXPECT_EQ(stats["noise"]["target_met"], true);
  EXPECT_LE(stats["noise"]["median"], 0.2);
  EXPECT_GE(stats["samples"]["least"], 16);
  EXPECT_GE(stats["samples"]["drawn_mean"], stats["samples"]["mean"]);
  EXPECT_GT(stats["memory"]["noise_bytes"], 24 * 16 * 98);
  const ExrImage picture = read_picture(folder / "out.exr");
  EXPECT_FLOAT_EQ(picture.numbers.at("noiseMedian"), stats["noise"]["median"].get<float>());
  EXPECT_FLOAT_EQ(picture.numbers.at("samplesPerPixel"), stats["samples"]["mean"].get<float>());
  const ProgramRun missed = run_shoal(folder, join(options, {"--target-noise", "0.1%", "--spp", "21"}));
  expect_exit(missed, 0);
  EXPECT_THAT(missed.err, HasSubstr("warning: the noise asked for (0.1 % at the median, 0.2 % at the 95th percentile) was "
                                    "not reached"));
  stats = parsed(file_text(folder / "out.json"));
  EXPECT_EQ(stats["noise"]["target_met"], false);
  EXPECT_EQ(stats["samples"]["most"], 20) << "pairs";
}

TEST(RenderScene, LayersAreWrittenIntoThePictureAndCompared) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const auto render = [&](const std::string& name, const std::vector<std::string>& options) {
    const ProgramRun run = run_shoal(folder, join(join({"render", folder / "terrain.shoal", "-o", folder / name, "--stats",
                                                        folder / "out.json"}, options), tiny_picture()));
    expect_exit(run, 0);
    return run;
  };
  EXPECT_THAT(render("plain.exr", {}).err, ::testing::Not(HasSubstr("AOVs")));
  EXPECT_THAT(render("a.exr", {"--aov", "normal,object_id,bytes", "--order", "queued"}).err, HasSubstr(", AOVs "));
  const json stats = parsed(file_text(folder / "out.json"));
  EXPECT_EQ(stats["options"]["aovs"], (json{"normal", "object_id", "bytes"}));
  EXPECT_GT(stats["memory"]["aov_bytes"], 0);
  render("b.exr", {"--aov", "normal", "--aov", "object_id,bytes", "--order", "sorted", "--page-cache", "2M"});
  std::vector<std::string> names;
  for (const ExrChannel& channel : read_picture(folder / "a.exr").channels) {
    names.push_back(channel.name);
    EXPECT_EQ(channel.integers.empty(), channel.name != "object_id.Y");
  }
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("R", "G", "B", "A", "normal.X", "normal.Y", "normal.Z",
                                                     "object_id.Y", "bytes.Y"));
  expect_exit(run_shoal(folder, {"diff", folder / "a.exr", folder / "b.exr"}), 0);
  const ProgramRun other = run_shoal(folder, {"diff", folder / "a.exr", folder / "plain.exr"});
  expect_exit(other, 10);
  EXPECT_THAT(other.out, HasSubstr("normal.X is in the first picture only"));
  EXPECT_THAT(other.out, HasSubstr("0 of 384 pixels differ")) << "the colour is the same";
}

TEST(RenderScene, CompareFindsTheOrdersIdentical) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run = run_shoal(folder, join({"compare", folder / "terrain.shoal", "--orders",
                                                 "queued,depth-first,sorted,hybrid", "--out", folder / "compare"},
                                                tiny_picture()));
  expect_exit(run, 0);
  EXPECT_THAT(run.out, HasSubstr("identical"));
  const json report = parsed(file_text(folder / "compare/compare.json"));
  EXPECT_EQ(report["pictures_identical"], true);
  ASSERT_TRUE(report["orders"].contains("queued") && report["orders"].contains("depth-first"));
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) {
    expect_stats(report["orders"][order], 24 * 16);
    EXPECT_EQ(report["orders"][order]["options"]["order"], order);
    const bool ahead = report["orders"][order]["options"]["read_backend"].get<std::string>() != "none";
    EXPECT_EQ(ahead, order == std::string("queued"));
  }
  EXPECT_EQ(report["orders"]["queued"]["counters"]["totals"]["rays_traced_count"],
            report["orders"]["depth-first"]["counters"]["totals"]["rays_traced_count"]);
}

TEST(RenderScene, CompareTakesOrdersWithTheirPoliciesEachUnderItsName) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::vector<std::string> names{"queued:full", "queued:sweep", "queued", "packet", "packet-reorder", "stream",
                                       "depth-first-while-while", "depth-first-if-if"};
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ",") + name;
  const ProgramRun run = run_shoal(folder, join({"compare", folder / "terrain.shoal", "--orders", list, "--out",
                                                 folder / "compare", "--packet-size", "32"}, tiny_picture()));
  expect_exit(run, 0);
  const json report = parsed(file_text(folder / "compare/compare.json"));
  EXPECT_EQ(report["pictures_identical"], true);
  EXPECT_EQ(report["orders"].size(), names.size());
  for (const std::string& name : names) {
    ASSERT_TRUE(report["orders"].contains(name)) << name;
    const json& options = report["orders"][name]["options"];
    const size_t colon = name.find(':');
    EXPECT_EQ(options["order"], name.substr(0, colon));
    EXPECT_EQ(options["policy"], colon == std::string::npos ? "resident-first" : name.substr(colon + 1));
    EXPECT_EQ(options["packet_size"], 32);
    EXPECT_THAT(run.out, HasSubstr(" " + name));
  }
  EXPECT_THAT(run.out, HasSubstr("lanes with work"));
}

TEST(RenderScene, AGltfIsBuiltOnceIntoTheCacheAndAgainWhenItChanges) {
  const TemporaryFolder folder;
  WrittenScene scene = one_triangle();
  save(scene, folder / "scene");
  const std::vector<std::string> render = join({"render", folder / "scene/scene.gltf", "-o", folder / "out.exr",
                                                "--cache-dir", folder / "cache", "--progress", "none"},
                                               tiny_picture());
  const ProgramRun first = run_shoal(folder, render);
  expect_exit(first, 0);
  EXPECT_THAT(first.err, HasSubstr("building "));
  const std::vector<std::string> built = folder.names("cache");
  ASSERT_EQ(built.size(), 1u);
  const auto written = std::filesystem::last_write_time(folder / ("cache/" + built[0]));
  const ProgramRun second = run_shoal(folder, render);
  expect_exit(second, 0);
  EXPECT_THAT(second.err, ::testing::Not(HasSubstr("building ")));
  EXPECT_EQ(folder.names("cache"), built);
  EXPECT_EQ(std::filesystem::last_write_time(folder / ("cache/" + built[0])), written);
  expect_exit(run_shoal(folder, join(render, {"--treelet-size", "64K"})), 0);
  EXPECT_EQ(folder.names("cache").size(), 2u);
  scene.add_node({{"mesh", 0}, {"translation", {0, 0, -1}}});
  save(scene, folder / "scene");
  EXPECT_THAT(run_shoal(folder, render).err, HasSubstr("building "));
  EXPECT_EQ(folder.names("cache").size(), 3u);
}

TEST(RenderScene, PositionsAreAsPreciseAsTheyWereBuilt) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const std::string gltf = folder / "terrain/terrain.gltf", coarse = folder / "coarse.shoal";
  const ProgramRun built = run_shoal(folder, {"build", gltf, "-o", coarse, "--positions", "16", "--quiet"});
  expect_exit(built, 0);
  const auto picture = [&](const std::string& scene, const std::string& name, const std::string& positions) {
    std::vector<std::string> command = join({"render", scene, "-o", folder / name, "--quiet"}, tiny_picture());
    if (!positions.empty()) command = join(command, {"--positions", positions});
    return run_shoal(folder, command);
  };
  expect_exit(picture(coarse, "a.exr", ""), 0);
  expect_exit(picture(coarse, "b.exr", "16"), 0);
  expect_exit(picture(gltf, "c.exr", "16"), 0);
  expect_exit(picture(gltf, "d.exr", "exact"), 0);
  expect_error(picture(coarse, "e.exr", "21"), 2, {"coarse.shoal", "was built with --positions 16"});
  expect_error(picture(coarse, "e.exr", "exact"), 2, {"coarse.shoal", "was built with --positions 16"});
  expect_error(picture(folder / "terrain.shoal", "e.exr", "16"), 2, {"terrain.shoal", "was built with --positions exact"});
  expect_exit(run_shoal(folder, {"diff", folder / "a.exr", folder / "c.exr"}), 0);
  expect_exit(run_shoal(folder, {"diff", folder / "a.exr", folder / "d.exr"}), 10);
  const ProgramRun info = run_shoal(folder, {"info", coarse});
  expect_exit(info, 0);
  EXPECT_THAT(info.out, HasSubstr("positions             16 bits, steps of up to"));
  const json described = parsed(run_shoal(folder, {"info", coarse, "--json"}).out);
  EXPECT_EQ(described["build"]["options"]["positions"], "16");
  EXPECT_GT(described["position_error"], 0);
}

TEST(RenderScene, WithoutCacheFolderTheUsersIsTaken) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "scene");
  expect_exit(run_shoal(folder, join({"render", folder / "scene/scene.gltf", "-o", folder / "out.exr", "--quiet"},
                                     tiny_picture())),
              0);
  EXPECT_EQ(folder.names(".cache/shoal").size(), 1u);
}

TEST(RenderScene, OneTriangleWithoutCameraOrLightIsFramedUnderAConstantSky) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "scene");
  const std::vector<std::string> render = {
      "render", folder / "scene/scene.gltf", "-o", folder / "out.exr", "--width", "32", "--height", "32", "--spp",
      "4"};
  const ProgramRun run = run_shoal(folder, render);
  expect_exit(run, 0);
  EXPECT_THAT(run.err, HasSubstr("warning: the scene has no light: lit by a constant sky"));
  const ExrImage image = read_picture(folder / "out.exr");
  uint32_t covered = 0, lit = 0;
  for (const ExrChannel& channel : image.channels) {
    for (const float value : channel.values) {
      ASSERT_GE(value, 0) << channel.name;
      covered += channel.name == "A" && value == 1;
      lit += channel.name == "G" && value > 0.1f;
    }
  }
  EXPECT_GT(covered, 100u) << "the triangle is in the frame";
  EXPECT_GT(lit, 900u) << "sky and triangle are lit";
  const ProgramRun dark = run_shoal(folder, join(render, {"--environment", "constant:0,0,0"}));
  expect_exit(dark, 0);
  EXPECT_THAT(dark.err, HasSubstr("warning: the scene has no light and the environment is black"));
}

TEST(RenderScene, SaysWhichNumbersWereNotFiniteAndWhere) {
  const TemporaryFolder folder;
  WrittenScene scene = one_triangle();
  const float most = 3e38f;  // between the corners they overflow, and zero times that is no number
  scene.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] =
      scene.add_floats(3, {-most, 1, 1, most, 1, 1, most, 1, 1});
  scene.json["meshes"][0]["primitives"][0]["material"] = 0;
  scene.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, 1, 1, 1}}}}}};
  save(scene, folder / "scene");
  const ProgramRun run = run_shoal(folder, join({"render", folder / "scene/scene.gltf", "-o", folder / "out.exr",
                                                 "--stats", folder / "stats.json"}, tiny_picture()));
  expect_exit(run, 0);
  EXPECT_THAT(run.err, HasSubstr(" contributions were not finite and were dropped (surface "));
  const nlohmann::json stats = nlohmann::json::parse(file_text(folder / "stats.json"));
  EXPECT_GT(stats["counters"]["totals"]["invalid_surface_count"], 10);
  EXPECT_EQ(stats["first_invalid"]["term"], "surface");
  for (const ExrChannel& channel : read_picture(folder / "out.exr").channels) {
    for (const float value : channel.values) ASSERT_TRUE(std::isfinite(value)) << channel.name;
  }
}

}  // namespace
}  // namespace shoal::testing
