#include "bins/checkpoint_options.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "engine/sums_file.h"

namespace shoal {
namespace {

struct When {
  bool on_stop = true;
  double every_seconds = 0;
};

Result<When> parse_when(const std::string& text) {
  if (text == "on-stop") return When{};
  if (text == "never") return When{false, 0};
  const std::string every = "every=";
  const auto seconds = text.starts_with(every) ? parse_duration(text.substr(every.size()))
                                               : Result<double>(Error{ErrorCode::kUsage, ""});
  if (seconds.ok()) return When{true, seconds.value()};
  return Error{ErrorCode::kUsage,
               fmt::format("--checkpoint {}: expected every=TIME such as every=10m, on-stop or never", text)};
}

bool is_there(const std::string& path) {
  std::error_code error;
  return std::filesystem::symlink_status(path, error).type() != std::filesystem::file_type::not_found;
}

}  // namespace

void CheckpointArguments::declare(CLI::App& app) {
  app.add_option(
         "--checkpoint", when,
         "when the render is written to PICTURE.checkpoint, from which --resume goes on: on-stop (by SIGTERM or "
         "SIGINT, which end it with code 9), every=TIME such as every=10m (and on-stop), never; "
         "docs/checkpoints.md")
      ->type_name("WHEN")
      ->capture_default_str();
  app.add_flag(
      "--resume", resume,
      "go on from PICTURE.checkpoint, to the same bits; without one start afresh. Order, memory and threads may be "
      "others, --spp more");
  app.add_option("--sample-range", range,
                 "of the samples of every pixel, those from A on, before B: -o is a part of raw sums then, and "
                 "`shoal merge` "
                 "makes a picture of parts")
      ->type_name("A:B");
}

Result<double> parse_duration(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, value);
  const std::string unit(rest, end);
  double seconds = 0;
  if (unit.empty() || unit == "s") seconds = 1;
  if (unit == "m") seconds = 60;
  if (unit == "h") seconds = 3600;
  if (unit == "d") seconds = 86400;
  value *= seconds;
  if (code != std::errc() || !(value > 0) || !std::isfinite(value)) {
    return Error{ErrorCode::kUsage, fmt::format("'{}' is no time: expected a number with s, m, h or d", text)};
  }
  return value;
}

Result<SampleSpan> parse_sample_range(const std::string& text) {
  if (text.empty()) return SampleSpan{};
  SampleSpan span;
  const char* end = text.data() + text.size();
  const auto [colon, code] = std::from_chars(text.data(), end, span.begin);
  if (code == std::errc() && colon != end && *colon == ':') {
    const auto [rest, second] = std::from_chars(colon + 1, end, span.end);
    if (second == std::errc() && rest == end && span.begin < span.end) return span;
  }
  return Error{ErrorCode::kUsage, fmt::format("--sample-range {}: expected A:B with A < B, such as 0:64", text)};
}

Status check_checkpoint_arguments(const CheckpointArguments& arguments) {
  SHOAL_ASSIGN_OR_RETURN(const When when, parse_when(arguments.when));
  if (arguments.resume && !when.on_stop) {
    return Error{ErrorCode::kUsage,
                 "--resume with --checkpoint never: what was done before would be lost when it is stopped"};
  }
  return parse_sample_range(arguments.range).ok() ? Status() : Status(parse_sample_range(arguments.range).error());
}

Result<CheckpointOptions> checkpoint_options(const CheckpointArguments& arguments, const std::string& output,
                                             Console& console) {
  SHOAL_ASSIGN_OR_RETURN(const When when, parse_when(arguments.when));
  CheckpointOptions options;
  if (!when.on_stop) return options;
  options.path = output + ".checkpoint";
  options.every_seconds = when.every_seconds;
  const bool there = is_there(options.path);
  options.resume = arguments.resume && there;
  if (options.resume) {
    SHOAL_ASSIGN_OR_RETURN(options.unfinished_count, unfinished_in(posix_file_system(), options.path));
    console.info(fmt::format("going on from {}", options.path));
  } else if (arguments.resume) {
    console.info(fmt::format("{}: there is none, the render starts afresh", options.path));
  } else if (there) {
    console.warning(
        fmt::format("{} is of a render that was not completed: --resume would go on from it, this one starts "
                    "afresh",
                    options.path));
  }
  return options;
}

void remove_checkpoint(const CheckpointOptions& options) {
  std::error_code ignored;
  if (!options.path.empty()) std::filesystem::remove(options.path, ignored);
}

}  // namespace shoal
