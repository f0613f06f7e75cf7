#include "bins/render_options.h"

#include <fmt/format.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <system_error>

#include "bins/accuracy_options.h"
#include "bins/builder_option.h"
#include "bins/choice_option.h"
#include "bins/lens_options.h"
#include "bins/positions_option.h"
#include "engine/find_scenes.h"
#include "engine/light_unlit_scene.h"
#include "engine/render_report.h"
#include "engine/source_files.h"
#include "treelets/build_object.h"

namespace shoal {
namespace {

std::filesystem::path default_cache_folder() {
  if (const char* folder = std::getenv("XDG_CACHE_HOME"); folder != nullptr && *folder == '/') {
    return std::filesystem::path(folder) / "shoal";
  }
  const char* home = std::getenv("HOME");
  return std::filesystem::path(home != nullptr ? home : "/tmp") / ".cache" / "shoal";
}

/// The .shoal of a glTF.
struct BuiltScene {
  std::string path;
  bool anew = false;
};

/// Built into the cache folder unless it is there already.
Result<BuiltScene> find_or_build(const RenderArguments& arguments, PreparedRender& prepared, Console& console) {
  FileSystem& fs = posix_file_system();
  SceneBuildOptions options = prepared.build;
  SHOAL_ASSIGN_OR_RETURN(const uint64_t key, build_cache_key(fs, arguments.scene, options));
  const std::filesystem::path folder =
      arguments.cache_folder.empty() ? default_cache_folder() : std::filesystem::path(arguments.cache_folder);
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) return Error{ErrorCode::kStorage, fmt::format("{}: cannot be made: {}", folder.string(), code.message())};
  const std::string path = (folder / fmt::format("{:016x}.shoal", key)).string();
  if (std::filesystem::exists(path, code)) return BuiltScene{path, false};
  console.info(fmt::format("building {} into {}", arguments.scene, path));
  options.planned = [&console](const BuildMemoryPlan& plan) { console.info(describe_plan(plan)); };
  options.progress = build_progress(console);
  options.stop = stop_on_signals();
  auto report = build_scene(fs, arguments.scene, path, options);
  console.end_progress();
  if (!report.ok()) return std::move(report).error();
  for (const std::string& warning : report.value().warnings) console.warning(warning);
  prepared.build_seconds = report.value().seconds;
  return BuiltScene{path, true};
}

Status choose_sky(const std::string& asked, PreparedRender& prepared, Console& console) {
  const bool off = (prepared.picture.shading.effects.off & kEffectEnvironment) != 0;
  if (!asked.empty() || off) {
    const EnvironmentOptions& sky = prepared.picture.shading.environment;
    if (prepared.scene.emitters.empty() && prepared.scene.lights.empty() &&
        (off || sky.intensity == 0 || (sky.kind == EnvironmentOptions::Kind::kConstant && sky.radiance == Vec3(0)))) {
      console.warning("the scene has no light and the environment is black: the picture will be black");
    }
    return {};
  }
  SHOAL_ASSIGN_OR_RETURN(const UnlitChoice choice, light_unlit_scene(posix_file_system(), prepared.scene,
                                                                     prepared.picture, prepared.execution));
  if (choice == UnlitChoice::kSky) {
    console.warning("the scene has no light: lit by a constant sky of 1 (choose one with --environment)");
  } else if (choice == UnlitChoice::kSkyAndLamp) {
    console.warning("the scene has no light and its geometry closes off the sky: lit by a lamp at the camera as well");
  }
  return {};
}

/// Refuses a cap that cannot work before tables are read. Each order must fit, beside pictures that are kept.
Status fit_cap(const PageFile& file, const std::vector<Order>& orders, uint32_t pictures_kept, PreparedRender& prepared) {
  const uint64_t picture_bytes = uint64_t{prepared.picture.width} * prepared.picture.height * 4 * sizeof(float);
  MemoryPlan plan;
  for (const Order order : orders) {
    ExecutionOptions execution = prepared.execution;
    execution.order = order;
    SHOAL_ASSIGN_OR_RETURN(plan, plan_before_tables(posix_file_system(), file, prepared.picture, execution,
                                                    pictures_kept * picture_bytes));
  }
  prepared.execution.process_bytes = plan.process_bytes;
  return {};
}

Result<EnvironmentOptions> chosen_environment(const RenderArguments& arguments) {
  SHOAL_ASSIGN_OR_RETURN(EnvironmentOptions chosen, parse_environment(arguments.environment));
  chosen.rotation = arguments.picture.shading.environment.rotation;
  chosen.intensity = arguments.picture.shading.environment.intensity;
  if (arguments.environment.empty() && (chosen.rotation != 0 || chosen.intensity != 1)) {
    return Error{ErrorCode::kUsage, "--environment-rotation and --environment-intensity need --environment"};
  }
  if (!std::isfinite(chosen.rotation)) {
    return Error{ErrorCode::kUsage, fmt::format("--environment-rotation {}: expected degrees", chosen.rotation)};
  }
  if (!(chosen.intensity >= 0) || chosen.intensity > 1e30f) {
    return Error{ErrorCode::kUsage, fmt::format("--environment-intensity {}: expected a number >= 0", chosen.intensity)};
  }
  return chosen;
}

Result<uint64_t> size_or_zero(const std::string& text) {
  if (text.empty()) return uint64_t{0};
  return parse_size(text);
}

}  // namespace

Result<uint64_t> parse_size(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, value);
  std::string unit(rest, end);
  if (unit.ends_with("iB")) unit.resize(unit.size() - 2);
  if (unit.ends_with("B")) unit.resize(unit.size() - 1);
  int shift = -1;
  if (unit.empty()) shift = 0;
  if (unit.size() == 1) {
    const size_t at = std::string("KMGT").find(static_cast<char>(std::toupper(static_cast<unsigned char>(unit[0]))));
    if (at != std::string::npos) shift = 10 * (static_cast<int>(at) + 1);
  }
  const double bytes = shift < 0 ? 0 : value * static_cast<double>(1ull << shift);
  if (code != std::errc() || !(bytes >= 1) || bytes >= 0x1p62) {
    return Error{ErrorCode::kUsage, fmt::format("'{}' is not a size: expected a number with K, M, G or T", text)};
  }
  return static_cast<uint64_t>(bytes);
}

Result<uint32_t> parse_treelet_size(const std::string& text) {
  SHOAL_ASSIGN_OR_RETURN(const uint64_t bytes, parse_size(text));
  if (bytes < kMinTreeletBytes || bytes > kMaxTreeletBytes) {
    return Error{ErrorCode::kUsage, fmt::format("a treelet size of {} bytes: must be 4K to 4M", bytes)};
  }
  return static_cast<uint32_t>(bytes);
}

Result<EnvironmentOptions> parse_environment(const std::string& text) {
  EnvironmentOptions environment;
  if (text.empty()) return environment;
  if (!text.starts_with("constant:")) {
    environment.kind = EnvironmentOptions::Kind::kImage;
    environment.path = text;
    return environment;
  }
  environment.kind = EnvironmentOptions::Kind::kConstant;
  const char* at = text.data() + 9;
  const char* end = text.data() + text.size();
  for (int c = 0; c < 3; ++c) {
    const auto [rest, code] = std::from_chars(at, end, environment.radiance[c]);
    const bool separated = c == 2 ? rest == end : rest != end && *rest == ',';
    if (code != std::errc() || !separated || !(environment.radiance[c] >= 0) || environment.radiance[c] > 1e30f) {
      return Error{ErrorCode::kUsage,
                   fmt::format("'{}' is not an environment: expected constant:R,G,B with numbers >= 0, F.hdr or F.exr",
                               text)};
    }
    at = rest + 1;
  }
  return environment;
}

const std::map<std::string, Order>& order_choices() {
  static const std::map<std::string, Order> kOrders{{"auto", Order::kAuto},
                                                     {"queued", Order::kQueued},
                                                     {"depth-first", Order::kDepthFirst},
                                                     {"sorted", Order::kSorted},
                                                     {"hybrid", Order::kHybrid},
                                                     {"packet", Order::kPacket},
                                                     {"packet-reorder", Order::kPacketReorder},
                                                     {"stream", Order::kStream},
                                                     {"depth-first-while-while", Order::kDepthFirstWhileWhile},
                                                     {"depth-first-if-if", Order::kDepthFirstIfIf}};
  return kOrders;
}

Result<Order> parse_order(const std::string& name) {
  const auto at = order_choices().find(name);
  if (at != order_choices().end()) return at->second;
  return Error{ErrorCode::kUsage,
               fmt::format("unknown order '{}': expected one of {}", name, choice_names(order_choices()))};
}

Status check_output(const std::string& path) {
  std::error_code code;
  const std::filesystem::file_status found = std::filesystem::status(path, code);
  if (std::filesystem::exists(found) && !std::filesystem::is_regular_file(found)) {
    return Error{ErrorCode::kStorage, fmt::format("{}: cannot be written: expected a file or nothing there, found {}", path,
                                                  std::filesystem::is_directory(found) ? "a folder" : "a device")};
  }
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return Error{ErrorCode::kStorage, fmt::format("{}: cannot be written: {}: {}", path, folder.string(),
                                                  std::generic_category().message(errno))};
  }
  return {};
}

void declare_pose(CLI::App& app, PoseOptions& pose) {
  app.add_option("--time", pose.time, "seconds into the animation that the scene is posed at (default: nodes at rest)");
  app.add_option("--animation", pose.animation, "its name or index (default: the first)")->type_name("NAME|INDEX");
  app.add_option_function<std::string>(
         "--shutter",
         [&pose](const std::string& text) {
           auto shutter = parse_shutter(text);
           if (!shutter.ok()) throw CLI::ValidationError("--shutter", shutter.error().message);
           pose.shutter = shutter.value();
         },
         "open from and to so many seconds after --time: nodes that move are blurred (default: an instant)")
      ->type_name("OPEN:CLOSE");
}

void RenderArguments::declare(CLI::App& app) {
  app.add_option("scene", scene, "scene: .gltf, .glb (built first where needed) or .shoal")->required();
  app.add_option("--width", picture.width, "picture width in pixels")->capture_default_str();
  app.add_option("--height", picture.height, "picture height in pixels")->capture_default_str();
  declare_accuracy(app, picture);
  samples = app.get_option("--spp");
  declare_lens(app, picture);
  declare_pose(app, pose);
  declare_positions(app, positions);
  app.add_option("--environment", environment, "constant:R,G,B or an equirectangular F.hdr or F.exr");
  app.add_option("--environment-rotation", picture.shading.environment.rotation,
                 "degrees by which the environment is turned, counter-clockwise seen from above")
      ->capture_default_str();
  app.add_option("--environment-intensity", picture.shading.environment.intensity,
                 "what its radiance is multiplied by")
      ->capture_default_str();
  app.add_option("--variant", variant, kVariantHelp);
  app.add_option("--effects", effects,
                 "force effects off or on: -NAME or +NAME, separated by commas (--effects=-sheen,-textures), all, "
                 "-all; `shoal info` lists them. On changes no picture")
      ->type_name("LIST");
  app.add_option("--threads", execution.threads, "threads; 0: all")->check(CLI::Range(0, 4096))->capture_default_str();
  app.add_option("--max-memory", max_memory, kMaxMemoryHelp);
  app.add_option("--policy", execution.policy, "which queue is drained next: resident-first, fullest, sweep, full")
      ->capture_default_str()
      ->group("For experiments");
  app.add_option("--queue-capacity", execution.policy_options.queue_capacity,
                 "policy full: rays and paths that fill a queue")
      ->capture_default_str()
      ->group("For experiments");
  app.add_option("--packet-size", execution.packet_rays, "orders packet and packet-reorder: rays of a packet, 16 to 256")
      ->capture_default_str()
      ->group("For experiments");
  static const std::map<std::string, ReadBackend> kBackends{
      {"auto", ReadBackend::kAuto}, {"io_uring", ReadBackend::kUring}, {"threads", ReadBackend::kThreads}};
  app.add_option("--eviction", execution.paging.eviction,
                 "which page leaves first: least-demand, least-waiting, least-recent")
      ->capture_default_str()
      ->group("For experiments");
  app.add_option("--read-depth", execution.paging.read_depth, "pages read ahead at once; 0: read when needed")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024))
      ->group("For experiments");
  app.add_option("--rays-ahead", execution.policy_options.rays_ahead,
                 "policy resident-first: reads ahead once fewer rays wait in memory (default: a quarter of the paths "
                 "in flight, at least 16384)")
      ->group("For experiments");
  add_choice(app, "--read-backend", execution.paging.backend, kBackends, ": how pages are read ahead")
      ->type_name("WAY")
      ->group("For experiments");
  app.add_option("--treelet-size", treelet_size, "bytes of a treelet when a glTF is built, 4K to 4M (default 256K)")
      ->group("For experiments");
  declare_builder(app, builder)->group("For experiments");
  app.add_option("--page-cache", page_cache, "bytes of decoded pages kept (default: from the plan)")
      ->group("For experiments");
  app.add_option("--rays-in-flight", execution.rays_in_flight,
                 "rays that may wait at once, two a path, at least 64 (default: from the plan)")
      ->group("For experiments");
  app.add_option("--tile-sample", picture.tile_sample,
                 "render one in so many tiles of 32 x 32 pixels, spread over the picture; figures are of those tiles")
      ->check(CLI::Range(1u, 1u << 22))
      ->capture_default_str()
      ->group("For experiments");
  app.add_option("--state-levels", more_levels, "levels of traversal state kept in a ray, 0 to 32")
      ->check(CLI::Range(0, 32))
      ->group("For experiments");
  app.add_flag("--buffered-reads", buffered_reads, "read through the operating system's cache")
      ->group("For experiments");
  app.add_flag("--allow-stale", allow_stale, "render a .shoal even if its source changed since it was built");
  app.add_option("--scratch", scratch_folder, "folder for what does not fit in memory when a glTF is built (default: "
                                              "that of the built scene)");
  app.add_option("--cache-dir", cache_folder,
                 "where built scenes are kept (default: $XDG_CACHE_HOME/shoal, else ~/.cache/shoal)");
  app.add_flag("--discard-built", discard_built,
               "do not keep the scene that is built: its file has no name any more once it is open");
}

Result<PreparedRender> prepare_render(const RenderArguments& arguments, const std::vector<Order>& orders,
                                      uint32_t pictures_kept, Console& console) {
  PreparedRender prepared;
  prepared.picture = arguments.picture;
  prepared.execution = arguments.execution;
  SHOAL_ASSIGN_OR_RETURN(prepared.execution.max_memory_bytes, size_or_zero(arguments.max_memory));
  SHOAL_ASSIGN_OR_RETURN(prepared.execution.page_cache_bytes, size_or_zero(arguments.page_cache));
  SHOAL_ASSIGN_OR_RETURN(prepared.picture.shading.environment, chosen_environment(arguments));
  SHOAL_ASSIGN_OR_RETURN(prepared.picture.shading.effects, parse_effects(arguments.effects));
  if (!arguments.variant.empty() && is_shoal_path(arguments.scene)) {
    return Error{ErrorCode::kUsage, "--variant is of a .gltf or .glb: a .shoal holds the variant that it was built with"};
  }
  SceneBuildOptions& build = prepared.build;
  build.variant = arguments.variant;
  build.threads = arguments.execution.threads;
  build.scratch_folder = arguments.scratch_folder;
  build.pose = arguments.pose;
  build.positions = arguments.positions.value_or(PositionPrecision::kExact);
  build.builder = arguments.builder.value_or(BvhBuilder::kSah);
  build.max_memory_bytes = prepared.execution.max_memory_bytes;
  if (!arguments.treelet_size.empty()) {
    SHOAL_ASSIGN_OR_RETURN(build.treelet_bytes, parse_treelet_size(arguments.treelet_size));
  }
  if (arguments.adjust_build) arguments.adjust_build(build);
  BuiltScene built{arguments.scene, false};
  if (!is_shoal_path(built.path)) {
    SHOAL_ASSIGN_OR_RETURN(built, find_or_build(arguments, prepared, console));
  }
  const ReadMode mode = arguments.buffered_reads ? ReadMode::kBuffered : ReadMode::kDirect;
  auto opened = PageFile::open(posix_file_system(), built.path, mode);
  if (built.anew && arguments.discard_built) SHOAL_RETURN_IF_ERROR(posix_file_system().remove(built.path));
  if (!opened.ok()) return std::move(opened).error();
  std::unique_ptr<PageFile> file = std::move(opened).value();
  SHOAL_RETURN_IF_ERROR(fit_cap(*file, orders, pictures_kept, prepared));
  SHOAL_ASSIGN_OR_RETURN(prepared.scene, read_scene(std::move(file), {arguments.more_levels}));
  if (is_shoal_path(arguments.scene)) {
    SHOAL_RETURN_IF_ERROR(check_pose(prepared.scene, arguments.pose));
    SHOAL_RETURN_IF_ERROR(check_positions(prepared.scene, arguments.positions));
    SHOAL_RETURN_IF_ERROR(check_builder(prepared.scene, arguments.builder));
  }
  if (is_shoal_path(arguments.scene) && !arguments.allow_stale) {
    SHOAL_RETURN_IF_ERROR(check_source_is_unchanged(posix_file_system(), prepared.scene));
  }
  SHOAL_RETURN_IF_ERROR(choose_sky(arguments.environment, prepared, console));
  return prepared;
}

RenderHooks console_hooks(Console& console) {
  RenderHooks hooks;
  hooks.stop = stop_on_signals();
  hooks.progress = [&console](const RenderProgress& p) {
    std::string detail = fmt::format("{:.2f} M samples/s, {} read",
                                     static_cast<double>(p.samples_done - p.samples_before) / p.seconds * 1e-6,
                                     format_bytes(p.disk_read_bytes));
    if (p.first_picture) detail += fmt::format(", first picture after {:.2f} s", p.first_picture->seconds);
    console.show_progress("rendering", p.fraction, p.seconds, detail, p.seconds_left);
  };
  hooks.warning = [&console](const std::string& message) { console.warning(message); };
  return hooks;
}

std::string describe_plan(const MemoryPlan& plan) {
  std::string text = fmt::format("memory: cap {}; process {}, top tree {}, tables {}, film {}",
                                 format_bytes(plan.cap_bytes), format_bytes(plan.process_bytes),
                                 format_bytes(plan.top_tree_bytes), format_bytes(plan.table_bytes),
                                 format_bytes(plan.film_bytes));
  if (plan.preview_bytes > 0) text += fmt::format(", preview {}", format_bytes(plan.preview_bytes));
  if (plan.aov_bytes > 0) text += fmt::format(", AOVs {}", format_bytes(plan.aov_bytes));
  if (plan.checkpoint_bytes > 0) text += fmt::format(", checkpoint {}", format_bytes(plan.checkpoint_bytes));
  if (plan.noise_bytes > 0) text += fmt::format(", noise {}", format_bytes(plan.noise_bytes));
  return text + fmt::format(", {} paths in flight {} and their rays {}, page cache {} of {} (geometry {}, attributes {}, "
                            "textures {}), read buffers {}, scratch {}",
                            plan.paths_in_flight, format_bytes(plan.path_state_bytes), format_bytes(plan.ray_bytes),
                            format_bytes(plan.cache_bytes), format_bytes(plan.scene_page_bytes()),
                            format_bytes(plan.geometry_page_bytes), format_bytes(plan.attribute_page_bytes),
                            format_bytes(plan.texture_page_bytes), format_bytes(plan.read_buffer_bytes),
                            format_bytes(plan.scratch_bytes));
}

std::string describe_samples(const RenderResult& result) {
  const SampleReport& samples = result.samples;
  std::string text = fmt::format("{} samples a pixel in {} passes", samples.most, samples.passes_count);
  if (samples.least < samples.most) {
    text = fmt::format("{:.1f} samples a pixel ({} to {}) in {} passes", samples.mean, samples.least, samples.most,
                       samples.passes_count);
  }
  if (result.noise) {
    text += fmt::format("; noise {:.2f} % at the median, {:.2f} % at the 95th percentile", 100 * result.noise->median,
                        100 * result.noise->percentile_95);
  }
  return text;
}

std::string describe_order(const ChosenOrder& chosen) {
  return fmt::format("order: {} ({})", order_name(chosen.order), chosen.reason);
}

std::string describe_plan(const BuildMemoryPlan& plan) {
  return fmt::format("memory: cap {}; process {}, threads {}, document {}, tables {}, coverage {}, writing {}; then "
                     "reading {} and sorting {}, or one chunk {} and {} pages in flight {}",
                     format_bytes(plan.cap_bytes), format_bytes(plan.process_bytes), format_bytes(plan.threads_bytes),
                     format_bytes(plan.document_bytes), format_bytes(plan.tables_bytes), format_bytes(plan.coverage_bytes),
                     format_bytes(plan.writing_bytes), format_bytes(plan.reading_bytes),
                     format_bytes(plan.buffers_bytes), format_bytes(plan.chunk_bytes), plan.pages_in_flight,
                     format_bytes(plan.pages_bytes));
}

std::function<void(const BuildProgress&)> build_progress(Console& console) {
  return [&console, start = std::chrono::steady_clock::now()](const BuildProgress& p) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    console.show_progress(p.stage, p.fraction, seconds, "");
  };
}

}  // namespace shoal
