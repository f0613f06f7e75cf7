// shoal batch: every scene under a folder.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <thread>

#include "bins/batch_options.h"
#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/batch_asked.h"
#include "engine/batch_run.h"
#include "engine/batch_text.h"
#include "engine/process_memory.h"
#include "engine/render_report.h"
#include "io/child_process.h"

namespace shoal {
namespace {

struct Arguments {
  std::string folder, out, max_memory, cache_folder;
  std::vector<std::string> include, exclude;
  RenderOptionRules rules;
  RenderOptions common;
  std::vector<std::string> behind_dashes;
  unsigned jobs = 0, threads = 0;  ///< 0: not given
  bool keep_built = false, force = false, resume = false, dry_run = false;
};

Result<std::string> absolute(const std::string& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error).lexically_normal();
  if (error) return Error{ErrorCode::kInput, fmt::format("{}: {}", escape_name(path), error.message())};
  std::string text = whole.string();
  while (text.size() > 1 && text.ends_with('/')) text.pop_back();
  return text;
}

/// Those remembered, with --resume, and what is given now in their place.
Result<BatchOptions> batch_options(const Arguments& arguments) {
  BatchOptions options;
  SHOAL_ASSIGN_OR_RETURN(const std::string out, absolute(arguments.out));
  if (arguments.resume) {
    SHOAL_ASSIGN_OR_RETURN(options, read_asked(posix_file_system(), out));
  }
  options.out = out;
  if (arguments.folder.empty() && !arguments.resume) {
    return Error{ErrorCode::kUsage, "the folder of the scenes is missing: shoal batch FOLDER --out FOLDER"};
  }
  if (!arguments.folder.empty()) {
    SHOAL_ASSIGN_OR_RETURN(const std::string folder, absolute(arguments.folder));
    if (arguments.resume && folder != options.folder) {
      return Error{ErrorCode::kUsage, fmt::format("--resume: the batch in {} is of {}, not of {}", escape_name(out),
                                                  escape_name(options.folder), escape_name(folder))};
    }
    options.folder = folder;
  }
  SHOAL_ASSIGN_OR_RETURN(const std::string here, absolute("."));
  RenderOptions common = arguments.common;
  SHOAL_ASSIGN_OR_RETURN(RenderOptions forced, parse_option_words(arguments.behind_dashes, arguments.rules));
  resolve_option_paths(common, here);
  resolve_option_paths(forced, here);
  options.common = merge_options(options.common, common);
  options.forced = merge_options(options.forced, forced);
  if (!arguments.include.empty()) options.include = arguments.include;
  if (!arguments.exclude.empty()) options.exclude = arguments.exclude;
  if (!arguments.max_memory.empty()) {
    SHOAL_ASSIGN_OR_RETURN(options.max_memory_bytes, parse_size(arguments.max_memory));
  }
  if (arguments.jobs > 0) options.jobs = arguments.jobs;
  if (arguments.threads > 0) options.threads = arguments.threads;
  if (!arguments.cache_folder.empty()) {
    SHOAL_ASSIGN_OR_RETURN(options.cache_folder, absolute(arguments.cache_folder));
  }
  options.keep_built = options.keep_built || arguments.keep_built || !options.cache_folder.empty();
  options.force = arguments.force;
  options.program = own_program();
  return options;
}

/// What each of the lines of --dry-run may use: the share of a job, where one was asked for.
BatchShare line_share(const BatchOptions& options) {
  const unsigned jobs = std::max(options.jobs, 1u);
  BatchShare share;
  if (options.max_memory_bytes > 0) share.memory_bytes = options.max_memory_bytes / jobs;
  if (options.max_memory_bytes == 0 && jobs > 1) share.memory_bytes = default_cap_bytes() / jobs;
  if (options.threads > 0 || jobs > 1) {
    const unsigned threads = options.threads > 0 ? options.threads : std::max(std::thread::hardware_concurrency(), 1u);
    share.threads = std::max(threads / jobs, 1u);
  }
  return share;
}

int print_lines(const Arguments& arguments, const BatchOptions& options, const BatchPlan& plan, Console& console) {
  bool failed = !plan.unreadable.empty();
  for (const std::string& sentence : plan.unreadable) console.warning(escape_name(sentence));
  for (const BatchScene& scene : plan.scenes) {
    if (scene.error) {
      console.warning(fmt::format("{}: {}", escape_name(scene.scene), escape_name(scene.error->message)));
      failed = true;
      continue;
    }
    const auto look = look_at_scene(posix_file_system(), options, arguments.rules, scene, stop_on_signals());
    if (!look.ok()) return console.error(look.error());
    if (look.value().done && !options.force) continue;
    fmt::print("{}\n", render_line(options, arguments.rules, scene, line_share(options)));
  }
  return failed ? kExitBatchFailed : 0;
}

std::string describe(const BatchEntry& entry) {
  const SceneRecord& record = entry.record;
  const std::string scene = escape_name(entry.scene.scene);
  if (entry.skipped) return fmt::format("{}: done before", scene);
  if (record.state == SceneState::kFailed) {
    return fmt::format("{}: failed (code {}): {}", scene, record.exit_code, escape_name(record.message));
  }
  return fmt::format("{}: done in {:.1f} s, {} read, {} at most resident{}", scene, record.seconds,
                     format_bytes(record.figures.disk_read_bytes), format_bytes(record.figures.peak_rss_bytes),
                     record.alone ? ", alone with the whole budget" : "");
}

BatchHooks batch_hooks(Console& console) {
  BatchHooks hooks;
  hooks.stop = stop_on_signals();
  hooks.warning = [&console](const std::string& message) { console.warning(message); };
  hooks.started = [&console](const BatchEntry& entry) {
    console.info(fmt::format("{}: begins, with {} and {} threads", escape_name(entry.scene.scene),
                             format_bytes(entry.record.max_memory_bytes), entry.record.threads));
  };
  hooks.ended = [&console](const BatchEntry& entry, const BatchCounts& counts) {
    const std::string line = fmt::format("[{}/{}] {}", counts.scenes - counts.left, counts.scenes, describe(entry));
    entry.record.state == SceneState::kFailed ? console.warning(line) : console.info(line);
  };
  hooks.progress = [&console](const BatchCounts& counts, double seconds) {
    const double fraction = static_cast<double>(counts.scenes - counts.left) / static_cast<double>(counts.scenes);
    console.show_progress("batch", fraction, seconds,
                          fmt::format("{} of {} scenes, {} failed", counts.scenes - counts.left, counts.scenes,
                                      counts.failed));
  };
  return hooks;
}

int run_command(const Arguments& arguments, Console& console) {
  const auto options = batch_options(arguments);
  if (!options.ok()) return console.error(options.error());
  const auto plan = plan_batch(posix_file_system(), options.value(), arguments.rules);
  if (!plan.ok()) return console.error(plan.error());
  if (arguments.dry_run) return print_lines(arguments, options.value(), plan.value(), console);
  for (const std::string& sentence : plan.value().unreadable) console.warning(escape_name(sentence));
  const BatchHooks hooks = batch_hooks(console);
  const auto result = run_batch(posix_file_system(), options.value(), arguments.rules, plan.value(), hooks);
  console.end_progress();
  if (!result.ok()) return console.error(result.error());
  const BatchCounts& counts = result.value().counts;
  console.info(fmt::format("{} scenes: {} done, {} done before, {} failed, {} left; {}", counts.scenes, counts.done,
                           counts.skipped, counts.failed, counts.left,
                           escape_name(BatchPaths(options.value().out).page())));
  if (result.value().stopped) {
    return console.error({ErrorCode::kStopped, "stopped; the same command, or --resume --out, goes on"});
  }
  return counts.failed > 0 || result.value().unreadable ? kExitBatchFailed : 0;
}

}  // namespace

void declare_batch(CLI::App& app, Console& console, Command& command, const std::vector<std::string>& behind_dashes) {
  auto arguments = std::make_shared<Arguments>();
  arguments->behind_dashes = behind_dashes;
  CLI::App* sub = app.add_subcommand("batch", "every scene under a folder");
  sub->add_option("folder", arguments->folder, "where the scenes are: .gltf, .glb and .shoal in any folder below it");
  sub->add_option("--out", arguments->out, "folder for the pictures, summary.json and summary.html")->required();
  sub->add_option("--include", arguments->include, "pattern of scenes or folders to render, such as 'rooms/**/*.glb' "
                                                   "(may be repeated; default: every scene)")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  sub->add_option("--exclude", arguments->exclude, "pattern of scenes or folders to leave out (may be repeated)")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  sub->add_option("--jobs", arguments->jobs, "renders at once; they share memory and threads (default 1)")
      ->check(CLI::Range(1, 4096));
  sub->add_option("--max-memory", arguments->max_memory,
                  "cap on all processes together, such as 2G (default: 70 % of the smaller of physical memory and "
                  "control-group limits)");
  sub->add_option("--threads", arguments->threads, "threads of all renders together (default: all)")
      ->check(CLI::Range(1, 4096));
  sub->add_flag("--keep-built", arguments->keep_built, "keep the .shoal of every glTF, for the next batch");
  sub->add_option("--cache-dir", arguments->cache_folder, "where they are kept; implies --keep-built");
  sub->add_flag("--force", arguments->force, "render again what is done");
  sub->add_flag("--resume", arguments->resume,
                "go on with the batch that wrote into --out, with the folder and the options that it had; what is done is "
                "skipped with or without it");
  sub->add_flag("--dry-run", arguments->dry_run, "print the commands that would run, one a line, for a shell; write nothing");
  sub->footer("Options behind -- are passed to every render, whatever its shoal.json says (docs/batch.md).\n"
              "Exit codes: 0 all done, 8 some failed (summary.json says which and why), 9 stopped.");
  // Only when it is this command: those of all others need not wait for it, nor hold it in memory.
  sub->preparse_callback([arguments, sub](size_t) {
    arguments->rules = render_option_rules();
    declare_passed_options(*sub, arguments->rules, arguments->common);
  });
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_command(*arguments, console); };
  });
}

}  // namespace shoal
