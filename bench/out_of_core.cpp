// bench/out_of_core: the claims about scenes that do not fit in memory, a subcommand a figure (docs/measuring.md).
// Every render is a process of its own, in a memory control group where the figure asks for one.
//
//   bench/out_of_core cap-held | quarter | rivals | amplification | split | random | policies | first-picture | check
//   [options: --help]
#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "bench/figures.h"
#include "bench/mapped_render.h"
#include "bench/random_rays.h"
#include "io/file.h"

namespace {

using namespace shoal;
using namespace shoal::bench;

struct Arguments {
  Setup setup;
  std::string gltf, json;
  uint64_t cap_bytes = 0;
  double share = 0.25;
  bool warm = true;
  std::vector<double> shares{0.25, 0.6};
  std::vector<uint64_t> rays{4'000'000, 16'000'000, 64'000'000};
  std::vector<double> factors{0.125, 0.25, 0.5, 1, 2, 4, 8};
  Rivals rivals;
  RandomRays random;
  Policies policies;
  MappedRender mapped;
  RandomRun random_run;
};

/// Counts such as 64M.
const CLI::AsNumberWithUnit kCounts(std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}});

std::string sibling(const char* name) {
  return (std::filesystem::read_symlink("/proc/self/exe").parent_path() / name).string();
}

/// What a picture is of, and where things are.
CLI::App* declare_figure(CLI::App& app, Arguments& a, const char* name, const char* what, bool needs_scene = true) {
  CLI::App* sub = app.add_subcommand(name, what);
  CLI::Option* scene = sub->add_option("--scene", a.setup.scene, "the .shoal");
  if (needs_scene) scene->required();
  sub->add_option("--width", a.setup.width, "pixels")->capture_default_str();
  sub->add_option("--height", a.setup.height, "pixels")->capture_default_str();
  sub->add_option("--spp", a.setup.samples, "samples a pixel")->capture_default_str();
  sub->add_option("--bounces", a.setup.bounces, "of a path")->capture_default_str();
  sub->add_option("--threads", a.setup.threads, "0: all")->capture_default_str();
  sub->add_option("--runs", a.setup.runs, "of which the median counts")->capture_default_str();
  sub->add_option("--program", a.setup.program, "the shoal that is measured")->capture_default_str();
  sub->add_option("--folder", a.setup.folder, "for temporary files, on the disk to be measured")->capture_default_str();
  sub->add_option("--json", a.json, "the figures as JSON");
  return sub;
}

void declare_figures(CLI::App& app, Arguments& a, std::function<Figure()>& figure) {
  CLI::App* cap = declare_figure(app, a, "cap-held", "the kernel's own count of memory against the cap", false);
  cap->add_option("--gltf", a.gltf, "built first, under the same cap");
  cap->add_option("--cap", a.cap_bytes, "such as 512M")->required()->transform(CLI::AsSizeValue(false));
  cap->callback([&] { figure = [&] { return figure_cap_held(a.setup, a.gltf, a.cap_bytes); }; });

  CLI::App* quarter = declare_figure(app, a, "quarter", "time with a quarter of the pages in memory and with all");
  quarter->add_option("--share", a.share, "of the pages")->capture_default_str();
  quarter->add_flag("!--no-warm", a.warm, "leave out the renders that the operating system's cache serves");
  quarter->callback([&] { figure = [&] { return figure_quarter(a.setup, a.share, a.warm); }; });

  CLI::App* rivals = declare_figure(app, a, "rivals", "queued against depth-first and mmap in the same memory");
  rivals->add_option("--share", a.rivals.share, "of the pages in the queued order's cache")->capture_default_str();
  rivals->add_option("--rivals", a.rivals.scenes, "the scene with other treelet sizes")->delimiter(',');
  rivals->add_option("--tile-sample", a.rivals.tile_sample, "the rivals render one in so many tiles")
      ->capture_default_str();
  rivals->add_option("--pages", a.rivals.mapped_pages, "decoded pages for mmap, made if missing and kept");
  rivals->add_option("--advice", a.rivals.advices, "for mapped pages: normal (read ahead), random, none (no such rival)")
      ->delimiter(',')
      ->check(CLI::IsMember({"normal", "random", "none"}))
      ->capture_default_str();
  rivals->callback([&] { figure = [&] { return figure_rivals(a.setup, a.rivals); }; });

  CLI::App* amplification = declare_figure(app, a, "amplification", "bytes read over bytes of all pages of the scene");
  amplification->add_option("--shares", a.shares, "of the pages in the cache")->delimiter(',')->capture_default_str();
  amplification->add_option("--rays", a.rays, "in flight")->delimiter(',')->transform(kCounts)->capture_default_str();
  amplification->callback([&] { figure = [&] { return figure_amplification(a.setup, a.shares, a.rays); }; });

  CLI::App* split = declare_figure(app, a, "split", "memory split between rays in flight and page cache");
  split->add_option("--shares", a.shares, "of the pages in the cache as split by itself")->delimiter(',')
      ->capture_default_str();
  split->add_option("--factors", a.factors, "of the paths that are chosen")->delimiter(',')->capture_default_str();
  split->callback([&] { figure = [&] { return figure_split(a.setup, a.shares, a.factors); }; });

  CLI::App* random = declare_figure(app, a, "random", "rays from anywhere into any direction");
  random->add_option("--rays", a.random.rays, "in all")->transform(kCounts)->capture_default_str();
  random->add_option("--in-flight", a.random.in_flight, "at once")->transform(kCounts)->capture_default_str();
  random->add_option("--share", a.random.share, "of the pages in the cache")->capture_default_str();
  random->add_option("--policy", a.random.policy, "which queue is drained next")->capture_default_str();
  random->add_option("--rays-ahead", a.random.rays_ahead, "reads ahead once fewer rays wait in memory (0: as renders)");
  random->callback([&] { figure = [&] { return figure_random(a.setup, a.random); }; });

  CLI::App* policies = declare_figure(app, a, "policies", "drain policies, eviction policies, reads ahead");
  policies->add_option("--share", a.policies.share, "of the pages in the cache")->capture_default_str();
  policies->add_option("--drains", a.policies.drains, "drain policies")->delimiter(',')->capture_default_str();
  policies->add_option("--evictions", a.policies.evictions, "eviction policies")->delimiter(',')->capture_default_str();
  policies->callback([&] { figure = [&] { return figure_policies(a.setup, a.policies); }; });

  CLI::App* first = declare_figure(app, a, "first-picture", "time to a first picture, and of reading the scene once");
  first->add_option("--cap", a.cap_bytes, "such as 512M")->transform(CLI::AsSizeValue(false));
  first->callback([&] { figure = [&] { return figure_first_picture(a.setup, a.cap_bytes); }; });

  CLI::App* check = declare_figure(app, a, "check", "all of them on a small scene, to see that they work", false);
  check->callback([&] { figure = [&] { return figure_check(a.setup); }; });
}

/// The child of `rivals`: takes what `shoal render` takes of a picture.
void declare_mapped_render(CLI::App& app, MappedRender& m, std::function<Status()>& child) {
  CLI::App* sub = app.add_subcommand("mapped-render", "one depth-first render over mapped pages (used by rivals)");
  sub->add_option("scene", m.scene, ".shoal")->required();
  sub->add_option("--pages", m.pages, "decoded pages")->required();
  sub->add_option("--advice", m.advice, "to the kernel: normal, random")->check(CLI::IsMember({"normal", "random"}));
  sub->add_option("-o", m.picture, "the picture, .exr")->required();
  sub->add_option("--stats", m.stats, "JSON")->required();
  sub->add_option("--width", m.options.width, "pixels");
  sub->add_option("--height", m.options.height, "pixels");
  sub->add_option("--spp", m.options.samples, "samples a pixel");
  sub->add_option("--bounces", m.options.shading.bounces, "of a path");
  sub->add_option("--threads", m.threads, "0: all");
  sub->add_option("--tile-sample", m.options.tile_sample, "one in so many tiles");
  sub->add_flag("--quiet", m.quiet, "prints nothing in any case");
  sub->add_option("--order", m.order, "depth-first")->check(CLI::IsMember({"depth-first"}));
  sub->callback([&] { child = [&m] { return mapped_render(m); }; });
}

/// The child of `random`.
void declare_random_rays(CLI::App& app, RandomRun& r, std::function<Status()>& child) {
  CLI::App* sub = app.add_subcommand("random-rays", "random rays through the queues (used by random)");
  sub->add_option("scene", r.scene, ".shoal")->required();
  sub->add_option("--stats", r.stats, "JSON")->required();
  sub->add_option("--rays", r.rays, "in all")->required();
  sub->add_option("--in-flight", r.in_flight, "at once")->required();
  sub->add_option("--page-cache", r.page_cache_bytes, "bytes of decoded treelets kept")->required();
  sub->add_option("--policy", r.policy, "which queue is drained next");
  sub->add_option("--rays-ahead", r.rays_ahead, "reads ahead once fewer rays wait in memory");
  sub->add_option("--threads", r.threads, "0: all");
  sub->callback([&] { child = [&r] { return trace_random_rays(r); }; });
}

/// Gone at the end with all that is in it.
struct WorkFolder {
  std::filesystem::path path;
  explicit WorkFolder(const std::string& parent) : path(parent + fmt::format("/shoal-bench-{}", ::getpid())) {
    std::filesystem::create_directories(path);
  }
  ~WorkFolder() {
    std::error_code code;
    std::filesystem::remove_all(path, code);
  }
};

int run_figure(Arguments& a, const std::function<Figure()>& figure) {
  const WorkFolder folder(a.setup.folder);
  a.setup.folder = folder.path.string();
  const Figure result = figure();
  if (a.json.empty()) return result.ok ? 0 : 1;
  const std::string text = result.json.dump(1) + "\n";
  const Status written = write_whole_file(posix_file_system(), a.json, std::as_bytes(std::span(text)));
  if (!written.ok()) give_up(written.error().message);
  return result.ok ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  arguments.setup.program = sibling("shoal");
  arguments.setup.this_program = sibling("out_of_core");
  arguments.setup.folder = std::filesystem::temp_directory_path().string();
  CLI::App app{"What happens when the scene does not fit in memory", "out_of_core"};
  app.require_subcommand(1);
  std::function<Figure()> figure;
  std::function<Status()> child;
  declare_figures(app, arguments, figure);
  declare_mapped_render(app, arguments.mapped, child);
  declare_random_rays(app, arguments.random_run, child);
  CLI11_PARSE(app, argc, argv);
  try {
    if (!child) return run_figure(arguments, figure);
  } catch (const std::exception& error) {
    fmt::print(stderr, "out_of_core: {}\n", error.what());
    return 1;
  }
  const Status status = child();
  if (!status.ok()) fmt::print(stderr, "out_of_core: {}\n", status.error().message);
  return status.ok() ? 0 : static_cast<int>(status.error().code);
}
