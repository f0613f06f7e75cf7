// shoal accuracy: what each accuracy knob costs on a scene, and what it brings.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <memory>

#include "bins/accuracy_page.h"
#include "bins/choice_option.h"
#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/accuracy_names.h"
#include "engine/accuracy_report.h"
#include "engine/find_scenes.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

struct Arguments {
  RenderArguments render;
  std::string out, budget = "5m", reference, tonemap = "pbr-neutral";
  std::vector<std::string> knobs;
  uint32_t seeds = 4, reference_samples = 1024;
  std::optional<float> exposure;
};

/// "90", "90s", "5m", "1h"; "none" is 0. Fails with: kUsage.
Result<double> parse_duration(const std::string& text) {
  if (text == "none") return 0.0;
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, value);
  const std::string unit(rest, end);
  const double scale = unit.empty() || unit == "s" ? 1 : unit == "m" ? 60 : unit == "h" ? 3600 : 0;
  if (code != std::errc() || !(value * scale > 0) || value * scale > 1e9) {
    return Error{ErrorCode::kUsage, fmt::format("'{}' is not a time: expected a number with s, m or h, or none", text)};
  }
  return value * scale;
}

std::vector<std::string> outputs(const Arguments& arguments) {
  return {arguments.out + "/accuracy.json", arguments.out + "/accuracy.csv", arguments.out + "/report.html"};
}

/// What can be said before the scene is read; makes the folder.
Status check_arguments(const Arguments& arguments) {
  SHOAL_RETURN_IF_ERROR(parse_tone_curve(arguments.tonemap));
  SHOAL_RETURN_IF_ERROR(parse_duration(arguments.budget));
  AccuracySettings base;
  base.picture = arguments.render.picture;
  SHOAL_RETURN_IF_ERROR(check_picture(base.picture));
  SHOAL_RETURN_IF_ERROR(choose_knobs(accuracy_knobs(base), arguments.knobs));
  if (base.picture.tile_sample != 1) {
    return Error{ErrorCode::kUsage, "--tile-sample leaves pixels black, which cannot be compared: leave it out"};
  }
  if (arguments.exposure && !std::isfinite(*arguments.exposure)) {
    return Error{ErrorCode::kUsage, fmt::format("an exposure of {} stops: must be a finite number", *arguments.exposure)};
  }
  std::error_code code;
  std::filesystem::create_directories(arguments.out, code);
  if (code) return Error{ErrorCode::kStorage, fmt::format("{}: cannot be made: {}", arguments.out, code.message())};
  for (const std::string& path : outputs(arguments)) SHOAL_RETURN_IF_ERROR(check_output(path));
  return {};
}

const ExrChannel* channel_of(const ExrImage& image, const std::string& name) {
  for (const ExrChannel& channel : image.channels) {
    if (channel.name == name) return &channel;
  }
  return nullptr;
}

/// Three channels as one picture; empty where one is missing.
RgbPicture join_channels(const ExrImage& image, const std::string& prefix) {
  const ExrChannel* channels[3] = {channel_of(image, prefix + "R"), channel_of(image, prefix + "G"),
                                   channel_of(image, prefix + "B")};
  RgbPicture picture;
  if (channels[0] == nullptr || channels[1] == nullptr || channels[2] == nullptr) return picture;
  for (size_t i = 0; i < channels[0]->values.size(); ++i) {
    for (const ExrChannel* channel : channels) picture.push_back(channel->values[i]);
  }
  return picture;
}

/// --reference into the job: R, G, B, and where the layers `variance` and `samples` are there its noise.
Status read_reference(const std::string& path, AccuracyJob& job) {
  const uint64_t pixels = uint64_t{job.sizes.width} * job.sizes.height;
  constexpr uint64_t kMaxChannels = 64;
  SHOAL_ASSIGN_OR_RETURN(const ExrImage image, read_exr(posix_file_system(), path, pixels * kMaxChannels / 4));
  job.reference = join_channels(image, "");
  if (image.width != job.sizes.width || image.height != job.sizes.height || job.reference.empty()) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected R, G and B of {} x {} pixels (--width, --height), found {} x {}",
                                                path, job.sizes.width, job.sizes.height, image.width, image.height)};
  }
  for (const float value : job.reference) {
    if (!std::isfinite(value)) {
      return Error{ErrorCode::kInput, path + ": expected finite values, found one that is not"};
    }
  }
  // The samples' variance says how far their mean may be off only where they are independent.
  const auto sampler = image.text.find("sampler");
  if (sampler == image.text.end() || sampler->second != sampler_name(SamplerKind::kIndependent)) return {};
  job.reference_variance = join_channels(image, "variance.");
  const ExrChannel* samples = channel_of(image, "samples.Y");
  for (size_t i = 0; i < job.reference_variance.size(); ++i) {
    const float count = samples != nullptr ? samples->values[i / 3] : 0;
    const float variance = job.reference_variance[i] / count;
    if (!(count > 1) || !(variance >= 0) || !std::isfinite(variance)) return job.reference_variance.clear(), Status{};
    job.reference_variance[i] = variance;
  }
  return {};
}

Result<AccuracyJob> make_job(const Arguments& arguments) {
  AccuracyJob job;
  const PictureOptions& picture = arguments.render.picture;
  job.knobs = arguments.knobs;
  job.sizes = {picture.width, picture.height, picture.samples, arguments.reference_samples};
  job.seeds = arguments.seeds;
  job.exposure = arguments.exposure;
  job.may_rebuild = !is_shoal_path(arguments.render.scene);
  SHOAL_ASSIGN_OR_RETURN(job.budget_seconds, parse_duration(arguments.budget));
  SHOAL_ASSIGN_OR_RETURN(job.curve, parse_tone_curve(arguments.tonemap));
  if (!arguments.reference.empty()) SHOAL_RETURN_IF_ERROR(read_reference(arguments.reference, job));
  return job;
}

/// Hooks that build and open the scene anew, one beside the base at a time, and show progress.
class Hooks {
 public:
  Hooks(const Arguments& arguments, Console& console) : arguments_(arguments), console_(console) {
    hooks.stop = stop_on_signals();
    hooks.progress = [this](const std::string& stage, double fraction, double seconds) {
      console_.show_progress(stage, fraction, seconds, "");
    };
    hooks.open = [this](const std::function<void(SceneBuildOptions&)>& change) { return open(change); };
    hooks.close = [this] { other_.reset(); };
  }

  AccuracyHooks hooks;

 private:
  Result<AccuracyScene> open(const std::function<void(SceneBuildOptions&)>& change) {
    other_.reset();
    RenderArguments changed = arguments_.render;
    changed.adjust_build = change;
    auto prepared = prepare_render(changed, {changed.execution.order}, accuracy_kept_pictures(arguments_.seeds), console_);
    if (!prepared.ok()) return std::move(prepared).error();
    other_ = std::make_unique<PreparedRender>(std::move(prepared).value());
    return AccuracyScene{&other_->scene, other_->execution, other_->build_seconds};
  }

  const Arguments& arguments_;
  Console& console_;
  std::unique_ptr<PreparedRender> other_;
};

std::string bias_cell(const NoiseAndBias& error) {
  return error.biased ? fmt::format("{:.2e}", error.bias_squared.value) : std::string("-");
}

void print_rows(const AccuracyResult& result) {
  size_t widest = 4;
  for (const AccuracyRow& row : result.rows) widest = std::max(widest, row.name.size());
  fmt::print("{:<{}} {:>10} {:>10} {:>9} {:>10} {:>8} {:>10} {:>10} {:>11}\n", "", widest + 2, "seconds", "from disk", "B/tri",
             "relMSE", "FLIP", "variance", "bias^2", "efficiency");
  for (const AccuracyRow& row : result.rows) {
    fmt::print("{:<{}} {:>10.3f} {:>10} {:>9.1f} {:>10.3e} {:>8.4f} {:>10.3e} {:>10} {:>11.4g}\n",
               std::string(row.pareto ? "* " : "  ") + row.name, widest + 2, row.seconds, format_bytes(row.disk_read_bytes),
               row.bytes_a_triangle, row.rel_mse, row.flip, row.error.variance.value, bias_cell(row.error),
               row.efficiency.value);
  }
  fmt::print("* none other is both faster and closer; bias^2: -: none found above the noise\n");
}

Status write_report(const Arguments& arguments, const PreparedRender& prepared, const AccuracyJob& job,
                    const AccuracyResult& result) {
  const std::vector<std::string> paths = outputs(arguments);
  const std::string json = accuracy_json(result, prepared.scene, job);
  const std::string name = std::filesystem::path(arguments.render.scene).filename().string();
  SHOAL_ASSIGN_OR_RETURN(const std::string html, report_html(accuracy_page(result, name, json)));
  const std::string texts[] = {json, accuracy_csv(result), html};
  for (size_t i = 0; i < paths.size(); ++i) {
    SHOAL_RETURN_IF_ERROR(write_whole_file(posix_file_system(), paths[i], std::as_bytes(std::span(texts[i]))));
  }
  return {};
}

int run_accuracy(const Arguments& arguments, Console& console) {
  if (const Status status = check_arguments(arguments); !status.ok()) return console.error(status.error());
  auto made = make_job(arguments);
  if (!made.ok()) return console.error(made.error());
  AccuracyJob& job = made.value();
  const auto prepared = prepare_render(arguments.render, {arguments.render.execution.order},
                                       accuracy_kept_pictures(arguments.seeds), console);
  if (!prepared.ok()) return console.error(prepared.error());
  job.base = {prepared.value().picture, prepared.value().build};
  job.execution = prepared.value().execution;
  job.build_seconds = prepared.value().build_seconds;
  Hooks hooks(arguments, console);
  const auto measured = measure_accuracy(posix_file_system(), prepared.value().scene, job, hooks.hooks);
  console.end_progress();
  if (!measured.ok()) return console.error(measured.error());
  const AccuracyResult& result = measured.value();
  const Status written = write_report(arguments, prepared.value(), job, result);
  if (!written.ok()) return console.error(written.error());
  for (const std::string& left : result.left_out) console.warning("left out: " + left);
  if (console.level >= LogLevel::kInfo) {
    print_rows(result);
    for (const AccuracySentence& sentence : accuracy_sentences(result)) fmt::print("\n{}\n", sentence.text);
  }
  return 0;
}

}  // namespace

void declare_accuracy(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("accuracy", "what each accuracy knob costs on a scene, and what it brings");
  arguments->render.declare(*sub);
  sub->add_option("--out", arguments->out, "folder for report.html, accuracy.json and accuracy.csv")->required();
  sub->add_option("--budget", arguments->budget,
                  "time for everything, such as 90s, 5m, 1h: lowers --width, --height, --spp and --reference-spp until "
                  "they fit; none: they stay")
      ->capture_default_str();
  sub->add_option("--seeds", arguments->seeds, "renders of each setting, with different random numbers")
      ->check(CLI::Range(kFewestSeeds, 64u))
      ->capture_default_str();
  sub->add_option("--knobs", arguments->knobs, "those to turn, separated by commas (default: all; docs/accuracy.md)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAMES");
  sub->add_option("--reference", arguments->reference,
                  "an .exr of the picture's size to compare with (default: rendered, every knob at its most accurate)");
  sub->add_option("--reference-spp", arguments->reference_samples, "samples a pixel of the reference")
      ->check(CLI::Range(4u, 1u << 22))
      ->capture_default_str();
  sub->add_option("--tonemap", arguments->tonemap, "of FLIP and the crops: pbr-neutral, none")->capture_default_str();
  sub->add_option("--exposure", arguments->exposure,
                  "of FLIP and the crops, in stops (default: the reference's log-mean luminance becomes 0.18)");
  add_choice(*sub, "--order", arguments->render.execution.order, order_choices(), " (the picture is the same)")
      ->type_name("ORDER");
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_accuracy(*arguments, console); };
  });
}

}  // namespace shoal
