#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {
namespace {

Json run_step(const std::string& step, const std::vector<std::string>& command, uint64_t limit_bytes,
              uint64_t cap_bytes, bool& ok) {
  const auto group = testing::MemoryGroup::create(limit_bytes);
  if (!group.ok()) fmt::print("{}: run without a group\n", group.error().message);
  const testing::MeasuredRun run = testing::run_measured(command, group.ok() ? &group.value() : nullptr);
  const uint64_t peak = group.ok() ? group.value().peak_bytes() : 0;
  const uint64_t kills = group.ok() ? group.value().oom_kills_count() : 0;
  const double share = static_cast<double>(peak) / static_cast<double>(cap_bytes);
  const bool held = limit_bytes == cap_bytes || share <= 1;
  ok = ok && run.exit_code == 0 && kills == 0 && held;
  fmt::print("{:<8} {:>10} {:>10} {:>5} {:>7} {:>9} {:>12} {:>9.1f} % {:>10} {:>9.1f}\n", step,
             format_bytes(cap_bytes), format_bytes(limit_bytes), run.exit_code, run.signal, kills, format_bytes(peak),
             100 * share, format_bytes(run.peak_rss_bytes), run.seconds);
  if (run.exit_code != 0) fmt::print("{}\n", run.output);
  return {{"step", step}, {"cap_bytes", cap_bytes}, {"group_limit_bytes", limit_bytes}, {"in_group", group.ok()},
          {"exit_code", run.exit_code}, {"signal", run.signal}, {"oom_kills_count", kills},
          {"group_peak_bytes", peak}, {"peak_rss_bytes", run.peak_rss_bytes}, {"seconds", run.seconds}};
}

}  // namespace

Figure figure_cap_held(const Setup& setup, const std::string& gltf, uint64_t cap_bytes) {
  Figure figure{Json::array()};
  fmt::print("{:<8} {:>10} {:>10} {:>5} {:>7} {:>9} {:>12} {:>11} {:>10} {:>9}\n", "step", "cap", "group", "exit",
             "signal", "oom kills", "group's peak", "of the cap", "peak RSS", "seconds");
  Setup with_scene = setup;
  const std::string cap = std::to_string(cap_bytes);
  for (const uint64_t limit : {2 * cap_bytes, cap_bytes}) {
    if (!gltf.empty()) {
      with_scene.scene = setup.folder + "/built.shoal";
      figure.json.push_back(run_step("build", {setup.program, "build", gltf, "-o", with_scene.scene, "--quiet",
                                               "--threads", std::to_string(setup.threads), "--max-memory", cap},
                                     limit, cap_bytes, figure.ok));
    }
    RenderAsk ask;
    ask.max_memory_bytes = cap_bytes;
    figure.json.push_back(
        run_step("render", render_command(with_scene, "capped", ask), limit, cap_bytes, figure.ok));
  }
  fmt::print("the cap {}\n", figure.ok ? "held" : "did NOT hold");
  return figure;
}

}  // namespace shoal::bench
