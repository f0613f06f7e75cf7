// shoal generate: scenes of any size.
#include <fmt/format.h>

#include <chrono>
#include <memory>

#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/generate.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

struct Arguments {
  GenerateOptions options;
  std::string triangles;
};

/// "2000000", "2M", "1.5G": decimal multiples, as people count triangles.
Result<uint64_t> parse_count(const std::string& text) {
  if (text.empty()) return uint64_t{0};
  size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  const std::string unit = text.substr(used);
  const double scale = unit.empty() ? 1 : unit == "K" || unit == "k" ? 1e3 : unit == "M" ? 1e6 : unit == "G" ? 1e9 : 0;
  if (used == 0 || scale == 0 || !(value > 0) || value * scale > 1e15) {
    return Error{ErrorCode::kUsage, fmt::format("'{}' is not a count: expected a number with K, M or G", text)};
  }
  return static_cast<uint64_t>(value * scale + 0.5);
}

int run_generate(const Arguments& arguments, Console& console) {
  GenerateOptions options = arguments.options;
  const auto triangles = parse_count(arguments.triangles);
  if (!triangles.ok()) return console.error(triangles.error());
  options.triangles = triangles.value();
  const auto start = std::chrono::steady_clock::now();
  const auto result = generate_scene(posix_file_system(), options, [&](const GenerateProgress& p) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    console.show_progress(p.stage, p.fraction, seconds, "");
  });
  console.end_progress();
  if (!result.ok()) return console.error(result.error());
  const GenerateReport& r = result.value();
  console.info(fmt::format("{}: {} triangles, {} seen in {} instances, {}", r.gltf_path, r.triangles_count,
                           r.instanced_triangles_count, r.instances_count, format_bytes(r.file_bytes)));
  return 0;
}

}  // namespace

void declare_generate(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("generate", "write a scene of any size");
  sub->add_option("kind", arguments->options.kind, "terrain, instances, tile or demo")->required();
  sub->add_option("--triangles", arguments->triangles, "about how many, such as 40M");
  sub->add_option("--out", arguments->options.out_dir, "folder for the .gltf and its parts")->required();
  sub->add_option("--source", arguments->options.source, "tile: the glTF to copy");
  sub->add_option("--seed", arguments->options.seed, "of the shapes")->capture_default_str();
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_generate(*arguments, console); };
  });
}

}  // namespace shoal
