#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/build_scene.h"
#include "engine/generate.h"

namespace shoal::bench {
namespace {

std::string built(const std::string& gltf, const std::string& path, uint32_t treelet_bytes) {
  SceneBuildOptions options;
  options.treelet_bytes = treelet_bytes;
  const auto report = build_scene(posix_file_system(), gltf, path, options);
  if (!report.ok()) give_up(report.error().message);
  return path;
}

}  // namespace

Figure figure_check(const Setup& asked) {
  Setup setup = asked;
  setup.width = 96, setup.height = 64, setup.samples = 1, setup.bounces = 2, setup.runs = 1;
  GenerateOptions options;
  options.kind = "terrain";
  options.triangles = 100'000;
  options.out_dir = setup.folder + "/scene";
  const auto scene = generate_scene(posix_file_system(), options);
  if (!scene.ok()) give_up(scene.error().message);
  const std::string gltf = scene.value().gltf_path;
  setup.scene = built(gltf, setup.folder + "/16k.shoal", 16u << 10);

  Figure all{Json::object()};
  const auto add = [&](const char* name, Figure figure) {
    const bool works = figure.ok && !figure.json.empty();
    all.ok = all.ok && works;
    all.json[name] = std::move(figure.json);
    fmt::print("{}: {}\n\n", name, works ? "works" : "FAILED");
  };
  add("cap-held", figure_cap_held(setup, gltf, 512ull << 20));
  add("quarter", figure_quarter(setup, 0.25));
  Rivals rivals;
  rivals.scenes = {built(gltf, setup.folder + "/64k.shoal", 64u << 10)};
  rivals.tile_sample = 2;
  add("rivals", figure_rivals(setup, rivals));
  add("amplification", figure_amplification(setup, {0.5}, {10'000}));
  add("split", figure_split(setup, {0.5}, {0.5, 1}));
  RandomRays random;
  random.rays = 20'000, random.in_flight = 5'000, random.share = 0.5;
  add("random", figure_random(setup, random));
  Policies policies;
  policies.drains = {"resident-first"}, policies.evictions = {"least-recent"};
  add("policies", figure_policies(setup, policies));
  add("first-picture", figure_first_picture(setup, 0));
  return all;
}

}  // namespace shoal::bench
