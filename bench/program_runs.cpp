#include "bench/program_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "engine/scene.h"
#include "io/page_file.h"

namespace shoal::bench {

void give_up(const std::string& sentence) {
  throw std::runtime_error(sentence);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

std::vector<std::string> render_command(const Setup& setup, const std::string& name, const RenderAsk& ask) {
  const auto text = [](uint64_t value) { return std::to_string(value); };
  std::vector<std::string> words{setup.program, "render", ask.scene.empty() ? setup.scene : ask.scene,
                                 "--quiet", "-o", setup.folder + "/" + name + ".exr",
                                 "--stats", setup.folder + "/" + name + ".json",
                                 "--width", text(setup.width), "--height", text(setup.height),
                                 "--spp", text(ask.samples > 0 ? ask.samples : setup.samples),
                                 "--bounces", text(setup.bounces), "--threads", text(setup.threads),
                                 "--order", ask.order, "--tile-sample", text(ask.tile_sample)};
  const auto add = [&](const char* option, uint64_t value) {
    if (value > 0) words.push_back(option), words.push_back(text(value));
  };
  add("--max-memory", ask.max_memory_bytes);
  add("--page-cache", ask.page_cache_bytes);
  add("--rays-in-flight", ask.rays_in_flight);
  words.insert(words.end(), ask.more.begin(), ask.more.end());
  return words;
}

RenderRun run_command(const Setup& setup, const std::string& name, const std::vector<std::string>& command,
                      const testing::MemoryGroup* group) {
  RenderRun run{name, {}, {}};
  const std::string stats = setup.folder + "/" + name + ".json";
  std::error_code code;
  std::filesystem::remove(stats, code);
  run.process = testing::run_measured(command, group);
  if (run.process.exit_code != 0) return run;
  std::ifstream file(stats);
  run.stats = Json::parse(file, nullptr, false);
  if (run.stats.is_discarded()) run.stats = nullptr;
  return run;
}

RenderRun run_render(const Setup& setup, const std::string& name, const RenderAsk& ask,
                     const testing::MemoryGroup* group) {
  return run_command(setup, name, render_command(setup, name, ask), group);
}

bool same_picture(const Setup& setup, const RenderRun& a, const RenderRun& b) {
  const auto picture = [&](const RenderRun& run) { return setup.folder + "/" + run.name + ".exr"; };
  return testing::run_measured({setup.program, "diff", picture(a), picture(b)}).exit_code == 0;
}

SceneSizes scene_sizes(const std::string& scene) {
  const auto file = PageFile::open(posix_file_system(), scene, ReadMode::kDirect);
  if (!file.ok()) give_up(file.error().message);
  SceneSizes sizes;
  const auto blocks = [](uint64_t bytes) { return (bytes + kPageAlignment - 1) / kPageAlignment * kPageAlignment; };
  for (const PageRecord& record : file.value()->records()) {
    if (record.kind == PageKind::kTable) continue;
    const uint64_t decoded = blocks(record.raw_bytes + 64ull), stored = blocks(record.stored_bytes);
    sizes.decoded_bytes += decoded;
    sizes.stored_bytes += stored;
    if (record.kind != PageKind::kTreelet) continue;
    ++sizes.treelets_count;
    sizes.treelets_decoded_bytes += decoded;
    sizes.treelets_stored_bytes += stored;
  }
  return sizes;
}

uint64_t cap_for_share(const Setup& setup, double share) {
  const SceneSizes sizes = scene_sizes(setup.scene);
  const double wanted = share * static_cast<double>(sizes.decoded_bytes);
  RenderAsk ask;
  ask.tile_sample = 1u << 20;  // one tile: only the plan is of interest
  uint64_t low = 0, high = 2 * sizes.decoded_bytes + (16ull << 30);
  while (high - low > std::max<uint64_t>(high / 500, 1 << 20)) {
    ask.max_memory_bytes = low + (high - low) / 2;
    const RenderRun run = run_render(setup, "plan", ask);
    const bool enough = run.ok() && static_cast<double>(run.memory("cache_bytes")) >= wanted;
    if (!run.ok() && run.process.exit_code != 5) give_up("the program failed: " + run.process.output);
    (enough ? high : low) = ask.max_memory_bytes;
  }
  return high;
}

}  // namespace shoal::bench
