// shoal render: a picture of a scene.
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "bins/checkpoint_options.h"
#include "bins/choice_option.h"
#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/render_record.h"
#include "engine/render_report.h"
#include "engine/tonemap.h"

namespace shoal {
namespace {

struct Arguments {
  RenderArguments render;
  CheckpointArguments checkpoint;
  std::string output, png, preview, stats, trace, tonemap = "pbr-neutral", target_noise;
  std::vector<std::string> aovs;
  float exposure = 0;
  double time_limit = 0;
  bool has_time_limit = false;
};

/// Of a render that ends by itself, where --spp does not say: as many as a pixel can hold; with --target-noise no more
/// than what makes sense for the few pixels that never become calm.
constexpr uint32_t kMostSamples = 1u << 22, kMostForNoise = 4096;

Result<AovSet> aovs_of(const Arguments& arguments) {
  return parse_aovs(fmt::format("{}", fmt::join(arguments.aovs, ",")));
}

/// What can be said before the scene is read.
Status check_arguments(const Arguments& arguments) {
  if (const auto curve = parse_tone_curve(arguments.tonemap); !curve.ok()) return curve.error();
  if (const auto aovs = aovs_of(arguments); !aovs.ok()) return aovs.error();
  if (!std::isfinite(arguments.exposure)) {
    return Error{ErrorCode::kUsage, fmt::format("an exposure of {} stops: must be a finite number", arguments.exposure)};
  }
  if (const auto noise = parse_noise_target(arguments.target_noise); !noise.ok()) return noise.error();
  if (arguments.has_time_limit && !(arguments.time_limit > 0 && std::isfinite(arguments.time_limit))) {
    return Error{ErrorCode::kUsage, fmt::format("--time-limit {}: expected seconds, more than 0", arguments.time_limit)};
  }
  if (arguments.has_time_limit && arguments.render.picture.shading.sampler == SamplerKind::kBlueNoise) {
    return Error{ErrorCode::kUsage,
                 "--time-limit with --sampler blue-noise: its points depend on the number of samples, which is not known "
                 "beforehand; take sobol"};
  }
  SHOAL_RETURN_IF_ERROR(check_checkpoint_arguments(arguments.checkpoint));
  if (!arguments.checkpoint.range.empty() && !(arguments.png.empty() && arguments.preview.empty())) {
    return Error{ErrorCode::kUsage, "--sample-range with --png or --preview: a part is no picture yet; `shoal merge` has --png"};
  }
  for (const std::string& path : {arguments.output, arguments.png, arguments.preview, arguments.stats,
                                  arguments.trace}) {
    if (!path.empty()) SHOAL_RETURN_IF_ERROR(check_output(path));
  }
  return {};
}

Result<ToneMapOptions> tone_of(const Arguments& arguments) {
  SHOAL_ASSIGN_OR_RETURN(const ToneCurve curve, parse_tone_curve(arguments.tonemap));
  return ToneMapOptions{curve, arguments.exposure};
}

/// The finished picture, under each of the names that are asked for.
Status write_pngs(const Arguments& arguments, const ExrImage& image) {
  if (arguments.png.empty() && arguments.preview.empty()) return {};
  SHOAL_ASSIGN_OR_RETURN(const ToneMapOptions tone, tone_of(arguments));
  const std::vector<uint8_t> rgb = tone_map_image(image.channels[0].values, image.channels[1].values,
                                                  image.channels[2].values, tone);
  for (const std::string& path : {arguments.png, arguments.preview}) {
    if (!path.empty()) SHOAL_RETURN_IF_ERROR(write_png(posix_file_system(), path, image.width, image.height, rgb));
  }
  return {};
}

Status write_outputs(const Arguments& arguments, const PreparedRender& prepared, const RenderResult& result) {
  if (prepared.execution.sums_path.empty()) {
    const ExrImage image = picture_image(result, prepared.scene, prepared.picture);
    SHOAL_RETURN_IF_ERROR(write_exr(posix_file_system(), arguments.output, image));
    SHOAL_RETURN_IF_ERROR(write_pngs(arguments, image));
  }
  if (arguments.stats.empty()) return {};
  const std::string json = stats_json(result, prepared.scene, prepared.picture, prepared.execution);
  return write_whole_file(posix_file_system(), arguments.stats, std::as_bytes(std::span(json)));
}

int run_render(const Arguments& arguments, Console& console) {
  if (const Status status = check_arguments(arguments); !status.ok()) return console.error(status.error());
  RenderArguments asked = arguments.render;
  asked.picture.aovs = aovs_of(arguments).value();
  asked.execution.preview = {arguments.preview, tone_of(arguments).value()};
  asked.execution.time_limit_seconds = arguments.time_limit;
  asked.picture.noise = parse_noise_target(arguments.target_noise).value();
  asked.picture.range = parse_sample_range(arguments.checkpoint.range).value();
  if (asked.picture.range.count() > 0) asked.execution.sums_path = arguments.output;
  if (asked.samples->count() == 0) {
    if (arguments.has_time_limit) asked.picture.samples = kMostSamples;
    if (asked.picture.noise.asked()) asked.picture.samples = kMostForNoise;
  }
  const auto checkpoint = checkpoint_options(arguments.checkpoint, arguments.output, console);
  if (!checkpoint.ok()) return console.error(checkpoint.error());
  asked.execution.checkpoint = checkpoint.value();
  RenderRecord record;
  if (!arguments.trace.empty()) {
    const Status opened = record.open_trace(posix_file_system(), arguments.trace);
    if (!opened.ok()) return console.error(opened.error());
    asked.execution.record = &record;
  }
  auto prepared = prepare_render(asked, {arguments.render.execution.order}, 0, console);
  if (!prepared.ok()) return console.error(prepared.error());
  PreparedRender& p = prepared.value();
  RenderHooks hooks = console_hooks(console);
  hooks.planned = [&console](const MemoryPlan& plan) { console.info(describe_plan(plan)); };
  hooks.chosen = [&console](const ChosenOrder& chosen) { console.info(describe_order(chosen)); };
  const auto result = render(posix_file_system(), p.scene, p.picture, p.execution, hooks);
  console.end_progress();
  const Status traced = record.finish_trace();  // of a render that was stopped as well
  if (!result.ok()) return console.error(result.error());
  const Status written = write_outputs(arguments, p, result.value());
  if (!written.ok()) return console.error(written.error());
  if (!traced.ok()) return console.error(traced.error());
  remove_checkpoint(p.execution.checkpoint);
  if (arguments.has_time_limit || p.picture.noise.asked()) console.info(describe_samples(result.value()));
  if (p.picture.noise.asked() && !(result.value().noise && result.value().noise->meets(p.picture.noise))) {
    console.warning(fmt::format("the noise asked for ({:.3g} % at the median, {:.3g} % at the 95th percentile) was not "
                                "reached", 100 * p.picture.noise.median, 100 * p.picture.noise.percentile_95));
  }
  std::string written_in = fmt::format("{} written in {:.2f} s", arguments.output, result.value().seconds);
  if (const auto& resumed = result.value().resumed) {
    written_in += fmt::format(", after {:.2f} s before it was resumed: what is counted came after that", resumed->seconds);
  }
  console.info(written_in);
  for (const std::string& warning : number_warnings(result.value().counters, p.picture.width)) {
    console.warning(warning);
  }
  if (console.level >= LogLevel::kInfo) {
    fmt::print("{}", traffic_table({{std::string(order_name(result.value().order.order)), &result.value()}}));
  }
  return 0;
}

}  // namespace

void declare_render(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("render", "scene to picture");
  arguments->render.declare(*sub);
  sub->add_option("-o,--output", arguments->output, "the picture, .exr; with --sample-range a part")->required();
  arguments->checkpoint.declare(*sub);
  sub->add_option("--png", arguments->png, "the picture as 8-bit sRGB PNG as well");
  sub->add_option("--preview", arguments->preview,
                  "a .png, written early from few samples, refreshed while rendering, finished at the end");
  sub->add_option("--tonemap", arguments->tonemap, "of --png and --preview: pbr-neutral, none")->capture_default_str();
  sub->add_option("--exposure", arguments->exposure, "of --png and --preview, in stops")->capture_default_str();
  sub->add_option("--stats", arguments->stats, "counters, options and machine as JSON");
  sub->add_option("--trace", arguments->trace,
                  "what each thread did, and queues and disk over time, for Perfetto (ui.perfetto.dev): Chrome trace format, "
                  "less than 100 MB a minute; docs/compare.md")
      ->type_name("F.json");
  sub->add_option("--aov", arguments->aovs,
                  "more layers in the picture, separated by commas, or all: albedo, normal, depth, position, variance, "
                  "samples, object_id, material_id, treelets, bytes (docs/aovs.md)")
      ->allow_extra_args(false)
      ->type_name("NAMES");
  add_choice(*sub, "--order", arguments->render.execution.order, order_choices(), " (the picture is the same)")
      ->type_name("ORDER");
  const CLI::Option* time_limit =
      sub->add_option("--time-limit", arguments->time_limit,
                      "seconds after which rendering ends, with the samples that fit; --spp is the most then (default: no "
                      "bound). The picture is that of --spp N for the N that is printed")
          ->type_name("SECONDS");
  sub->add_option("--target-noise", arguments->target_noise,
                  "samples where it is noisy, until the standard error relative to the pixel's luminance is so much at the "
                  "median pixel and twice that at the 95th percentile, or as given: 2%, 0.02, 2%:5%. --spp is the most then "
                  "(default: 4096); docs/adaptive_sampling.md")
      ->type_name("M[:P]");
  sub->callback([arguments, time_limit, &console, &command] {
    arguments->has_time_limit = time_limit->count() > 0;
    command = [arguments, &console] { return run_render(*arguments, console); };
  });
}

}  // namespace shoal
