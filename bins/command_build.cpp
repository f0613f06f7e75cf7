// shoal build: glTF to .shoal.
#include <fmt/format.h>

#include <memory>

#include "bins/builder_option.h"
#include "bins/command.h"
#include "bins/positions_option.h"
#include "bins/render_options.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

struct BuildArguments {
  std::string scene, output, treelet_size, max_memory, scratch_folder, variant;
  unsigned threads = 0;
  bool consume = false;
  PoseOptions pose;
  std::optional<PositionPrecision> positions;
  std::optional<BvhBuilder> builder;
};

Result<SceneBuildReport> build(const BuildArguments& arguments, Console& console) {
  SceneBuildOptions options;
  options.threads = arguments.threads;
  if (!arguments.treelet_size.empty()) {
    SHOAL_ASSIGN_OR_RETURN(options.treelet_bytes, parse_treelet_size(arguments.treelet_size));
  }
  if (!arguments.max_memory.empty()) {
    SHOAL_ASSIGN_OR_RETURN(options.max_memory_bytes, parse_size(arguments.max_memory));
  }
  SHOAL_RETURN_IF_ERROR(check_output(arguments.output));
  options.scratch_folder = arguments.scratch_folder;
  options.consume = arguments.consume;
  options.variant = arguments.variant;
  options.positions = arguments.positions.value_or(PositionPrecision::kExact);
  options.builder = arguments.builder.value_or(BvhBuilder::kSah);
  options.pose = arguments.pose;
  options.planned = [&console](const BuildMemoryPlan& plan) { console.info(describe_plan(plan)); };
  options.progress = build_progress(console);
  options.stop = stop_on_signals();
  return build_scene(posix_file_system(), arguments.scene, arguments.output, options);
}

int run_build(const BuildArguments& arguments, Console& console) {
  const auto result = build(arguments, console);
  console.end_progress();
  if (!result.ok()) return console.error(result.error());
  const SceneBuildReport& r = result.value();
  for (const std::string& warning : r.warnings) console.warning(warning);
  console.info(fmt::format("{}: {} triangles in {} treelets, {} instances of {} objects, {} ({:.1f} bytes a triangle), "
                           "{:.1f} s, {:.2f} M triangles/s",
                           arguments.output, r.triangles_count, r.treelets_count, r.instances_count, r.objects_count,
                           format_bytes(r.file_bytes),
                           static_cast<double>(r.file_bytes) / static_cast<double>(std::max<uint64_t>(r.triangles_count, 1)),
                           r.seconds, static_cast<double>(r.triangles_count) / std::max(r.seconds, 1e-9) * 1e-6));
  if (r.chunks_count > 0) {
    console.info(fmt::format("built out of core in {} chunks, {} through the scratch file", r.chunks_count,
                             format_bytes(r.scratch_written_bytes)));
  }
  if (r.position_step > 0) {
    console.info(fmt::format("positions in steps of up to {:g}: no point moved by more than {:g} in space", r.position_step,
                             r.position_error));
  }
  if (arguments.consume) console.info(fmt::format("{} of the source given back", format_bytes(r.consumed_bytes)));
  if (r.degenerate_count > 0) console.info(fmt::format("{} degenerate triangles skipped", r.degenerate_count));
  if (r.zero_area_count > 0) console.info(fmt::format("{} triangles have no area", r.zero_area_count));
  return 0;
}

}  // namespace

void declare_build(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<BuildArguments>();
  CLI::App* sub = app.add_subcommand("build", "scene to paged file");
  sub->add_option("scene", arguments->scene, "a .gltf or .glb")->required();
  sub->add_option("-o,--output", arguments->output, "the .shoal to write")->required();
  sub->add_option("--treelet-size", arguments->treelet_size, "bytes of a treelet, 4K to 4M (default 256K)");
  sub->add_option("--max-memory", arguments->max_memory, kMaxMemoryHelp);
  sub->add_option("--scratch", arguments->scratch_folder,
                  "folder for what does not fit in memory: 40 bytes a triangle and 12 for each float of a corner's "
                  "attributes (default: that of the output)");
  declare_builder(*sub, arguments->builder);
  declare_positions(*sub, arguments->positions);
  sub->add_option("--variant", arguments->variant, kVariantHelp);
  sub->add_flag("--consume", arguments->consume,
                "DESTROYS the source: gives the disk space of its .bin parts back while they are read, even if the build "
                "fails later; .gltf and images stay; not for .glb");
  declare_pose(*sub, arguments->pose);
  sub->add_option("--threads", arguments->threads, "threads; 0: all")->check(CLI::Range(0, 4096))->capture_default_str();
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_build(*arguments, console); };
  });
}

}  // namespace shoal
