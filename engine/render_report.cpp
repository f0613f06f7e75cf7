#include "engine/render_report.h"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "engine/accuracy_names.h"
#include "engine/camera.h"
#include "engine/effects.h"
#include "engine/film.h"
#include "engine/process_memory.h"
#include "treelets/bvh_builder_kind.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;
using Matrix = std::array<float, 16>;

double ratio(uint64_t a, uint64_t b) { return b == 0 ? 0.0 : static_cast<double>(a) / static_cast<double>(b); }

/// Row-vector matrices, as OpenEXR's attributes are: p' = p M.
Matrix world_to_camera(const Affine3& c) {
  const Vec3 x = glm::normalize(c.column_x), y = glm::normalize(c.column_y), z = glm::normalize(c.column_z);
  const Vec3 t = c.translation;
  return {x.x, y.x, z.x, 0, x.y, y.y, z.y, 0, x.z, y.z, z.z, 0, -glm::dot(t, x), -glm::dot(t, y), -glm::dot(t, z), 1};
}

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix m{};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      for (int k = 0; k < 4; ++k) m[i * 4 + j] += a[i * 4 + k] * b[k * 4 + j];
    }
  }
  return m;
}

/// Camera space to [-1, 1] in x and y; z keeps the distance along the view (perspective divides by -z).
Matrix camera_to_ndc(const CameraRecord& camera, float aspect) {
  if (camera.perspective != 0) {
    const float y = 1.0f / camera.tan_half_yfov;
    return {y / aspect, 0, 0, 0, 0, y, 0, 0, 0, 0, -1, -1, 0, 0, 0, 0};
  }
  const float y = 1.0f / camera.ymag;
  return {y / aspect, 0, 0, 0, 0, y, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1};
}

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  }
  return "unknown";
}

Json machine_json() {
  utsname name{};
  uname(&name);
  return {{"cpu", cpu_name()},
          {"hardware_threads_count", std::thread::hardware_concurrency()},
          {"memory_limit_bytes", memory_limit_bytes()},
          {"system", fmt::format("{} {} {}", name.sysname, name.release, name.machine)},
          {"compiler", __VERSION__}};
}

Json plan_json(const MemoryPlan& plan) {
  return {{"cap_bytes", plan.cap_bytes},
          {"process_bytes", plan.process_bytes},
          {"top_tree_bytes", plan.top_tree_bytes},
          {"table_bytes", plan.table_bytes},
          {"film_bytes", plan.film_bytes},
          {"preview_bytes", plan.preview_bytes},
          {"aov_bytes", plan.aov_bytes},
          {"noise_bytes", plan.noise_bytes},
          {"checkpoint_bytes", plan.checkpoint_bytes},
          {"path_state_bytes", plan.path_state_bytes},
          {"ray_bytes", plan.ray_bytes},
          {"paths_bytes", plan.paths_bytes()},
          {"cache_bytes", plan.cache_bytes},
          {"read_buffer_bytes", plan.read_buffer_bytes},
          {"scratch_bytes", plan.scratch_bytes},
          {"total_bytes", plan.total_bytes()},
          {"paths_in_flight_count", plan.paths_in_flight},
          {"read_depth_count", plan.read_depth},
          {"scene_page_bytes", plan.scene_page_bytes()},
          {"geometry_page_bytes", plan.geometry_page_bytes},
          {"attribute_page_bytes", plan.attribute_page_bytes},
          {"texture_page_bytes", plan.texture_page_bytes}};
}

Json phases_json(const PhaseTimes& phases) {
  Json seconds, shares, meanings;
#define SHOAL_ADD(phase, name, sentence)         \
  seconds[name] = phases.of(Phase::phase);       \
  shares[name] = phases.share(Phase::phase);     \
  meanings[name] = sentence;
  SHOAL_PHASES(SHOAL_ADD)
#undef SHOAL_ADD
  return {{"thread_seconds", phases.total()},
          {"seconds", seconds},
          {"shares", shares},
          {"routing_share", phases.routing_share()},
          {"meanings", meanings}};
}

/// As --environment takes it.
std::string environment_text(const EnvironmentOptions& environment) {
  if (environment.kind == EnvironmentOptions::Kind::kNone) return "none";
  if (environment.kind == EnvironmentOptions::Kind::kImage) return environment.path;
  const Vec3& radiance = environment.radiance;
  return fmt::format("constant:{},{},{}", radiance.x, radiance.y, radiance.z);
}

Json lens_json(const Scene& scene, const PictureOptions& picture) {
  static constexpr const char* kNames[] = {"scene", "perspective", "orthographic", "equirectangular", "fisheye"};
  const LensOptions& lens = picture.lens;
  const CameraRecord record =
      scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[picture.camera];
  Json json = {{"projection", kNames[static_cast<size_t>(projection_of(record, lens))]}};
  if (lens.fov_degrees > 0) json["fov_degrees"] = lens.fov_degrees;
  if (lens.height > 0) json["height"] = lens.height;
  if (lens.aperture > 0) json["aperture"] = lens.aperture;
  if (lens.f_stop > 0) json["f_stop"] = lens.f_stop;
  if (lens.focus_distance > 0) json["focus_distance"] = lens.focus_distance;
  if (lens.distortion.model != DistortionModel::kNone) {
    json["distortion_model"] = lens.distortion.model == DistortionModel::kRadial ? "radial" : "brown";
    json["distortion"] = lens.distortion.k;
  }
  return json;
}

Json roulette_json(uint32_t start) { return start == ShadingOptions::kNoRoulette ? Json("off") : Json(start); }

Json options_json(const RenderResult& result, const Scene& scene, const PictureOptions& picture,
                  const ExecutionOptions& execution) {
  return {{"width", picture.width},
          {"height", picture.height},
          {"samples_per_pixel", picture.samples},
          {"sample_range", picture.range.count() > 0 ? Json::array({picture.range.begin, picture.range.end}) : Json()},
          {"checkpoint_seconds", execution.checkpoint.every_seconds},
          {"time_limit_seconds", execution.time_limit_seconds},
          {"target_noise_median", picture.noise.median},
          {"target_noise_percentile_95", picture.noise.percentile_95},
          {"camera", picture.camera},
          {"lens", lens_json(scene, picture)},
          {"tile_sample", picture.tile_sample},
          {"bounces", picture.shading.bounces},
          {"roulette_start", roulette_json(picture.shading.roulette_start)},
          {"clamp_direct", picture.shading.clamp_direct},
          {"clamp_indirect", picture.shading.clamp_indirect},
          {"sampler", sampler_name(picture.shading.sampler)},
          {"seed", picture.shading.seed},
          {"environment", environment_text(picture.shading.environment)},
          {"environment_rotation_degrees", picture.shading.environment.rotation},
          {"environment_intensity", picture.shading.environment.intensity},
          {"light_choice", light_choice_name(picture.shading.light_choice)},
          {"effects", effects_text(picture.shading.effects)},
          {"texture_filter", texture_filter_name(picture.shading.texture_filter)},
          {"triangle_test", triangle_test_name(picture.shading.triangle_test)},
          {"aovs", aov_names(picture.aovs)},
          {"order", order_name(result.order.order)},
          {"order_asked", order_name(execution.order)},
          {"order_reason", result.order.reason},
          {"policy", execution.policy},
          {"queue_capacity", execution.policy_options.queue_capacity},
          {"packet_size", execution.packet_rays},
          {"rays_ahead", execution.policy_options.rays_ahead},
          {"eviction", execution.paging.eviction},
          {"read_depth", execution.paging.read_depth},
          {"read_backend", result.read_backend},
          {"buffered_reads", scene.file->read_mode() == ReadMode::kBuffered},
          {"state_levels", scene.top_tree.more_levels()},
          {"max_memory_bytes", execution.max_memory_bytes},
          {"page_cache_bytes", execution.page_cache_bytes},
          {"rays_in_flight", execution.rays_in_flight}};
}

/// What trades accuracy for time, as the options name it.
void add_accuracy(const ShadingOptions& shading, ExrImage& image) {
  image.text["sampler"] = sampler_name(shading.sampler);
  image.text["lightChoice"] = light_choice_name(shading.light_choice);
  image.text["textureFilter"] = texture_filter_name(shading.texture_filter);
  image.text["triangleTest"] = triangle_test_name(shading.triangle_test);
  image.numbers["bounces"] = static_cast<float>(shading.bounces);
  const bool roulette = shading.roulette_start != ShadingOptions::kNoRoulette;
  image.text["rouletteStart"] = roulette ? fmt::format("{}", shading.roulette_start) : "off";
  image.numbers["clampDirect"] = shading.clamp_direct;
  image.numbers["clampIndirect"] = shading.clamp_indirect;
}

Json invalid_json(const RenderCounters& counters, uint32_t width) {
  const InvalidPlace& at = counters.first_invalid;
  if (at.pixel == kNoIndex) return nullptr;
  return {{"term", kInvalidTermNames[static_cast<size_t>(at.term)]},
          {"x", at.pixel % width},
          {"y", at.pixel / width},
          {"sample", at.sample},
          {"vertex", at.bounce}};
}

}  // namespace

std::string format_bytes(uint64_t bytes) {
  static constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  double value = static_cast<double>(bytes);
  size_t unit = 0;
  while (value >= 1000 && unit + 1 < std::size(kUnits)) value /= 1024, ++unit;
  if (unit == 0) return fmt::format("{} B", bytes);
  return fmt::format("{:.{}f} {}", value, value < 10 ? 2 : value < 100 ? 1 : 0, kUnits[unit]);
}

std::string machine_description() { return machine_json().dump(); }

EffectAskers effect_askers(const PictureOptions& picture) {
  EffectAskers askers;
  const EnvironmentOptions& sky = picture.shading.environment;
  if (sky.kind != EnvironmentOptions::Kind::kNone) {
    askers.environment = sky.fallback ? "a scene without light" : "--environment";
  }
  const bool aperture = picture.lens.aperture > 0 || picture.lens.f_stop > 0;
  const bool distortion = picture.lens.distortion.model != DistortionModel::kNone;
  if (aperture) askers.lens = distortion ? "--aperture with --distortion" : "--aperture";
  if (distortion && !aperture) askers.lens = "--distortion";
  return askers;
}

void add_channels(const std::vector<float>& rgba, const std::vector<ExrChannel>& layers, ExrImage& image) {
  const size_t pixels = rgba.size() / 4;
  static constexpr const char* kNames[] = {"R", "G", "B", "A"};
  for (size_t c = 0; c < 4; ++c) {
    ExrChannel channel{kNames[c], false, std::vector<float>(pixels)};
    for (size_t i = 0; i < pixels; ++i) channel.values[i] = rgba[i * 4 + c];
    image.channels.push_back(std::move(channel));
  }
  image.channels.insert(image.channels.end(), layers.begin(), layers.end());
}

ExrImage described_image(const Scene& scene, const PictureOptions& picture) {
  ExrImage image;
  image.width = picture.width;
  image.height = picture.height;
  const CameraRecord record =
      scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[picture.camera];
  const CameraRecord camera = seen_through(record, picture.lens);
  const float aspect = static_cast<float>(picture.width) / static_cast<float>(picture.height);
  const Matrix to_camera = world_to_camera(camera.camera_to_world);
  image.text["software"] = "Shoal " SHOAL_VERSION;
  add_accuracy(picture.shading, image);
  image.matrices["worldToCamera"] = to_camera;
  const Projection projection = projection_of(record, picture.lens);
  const bool flat = projection == Projection::kPerspective || projection == Projection::kOrthographic;
  if (flat) image.matrices["worldToNDC"] = multiply(to_camera, camera_to_ndc(camera, aspect));
  return image;
}

ExrImage picture_image(const RenderResult& result, const Scene& scene, const PictureOptions& picture) {
  ExrImage image = described_image(scene, picture);
  add_channels(result.rgba, result.layers, image);
  const double before = result.resumed ? result.resumed->seconds : 0;
  image.numbers["renderTimeSeconds"] = static_cast<float>(before + result.seconds);
  image.numbers["samplesPerPixel"] = static_cast<float>(result.samples.mean);
  if (result.noise) {
    image.numbers["noiseMedian"] = result.noise->median;
    image.numbers["noisePercentile95"] = result.noise->percentile_95;
  }
  return image;
}

std::string stats_json(const RenderResult& result, const Scene& scene, const PictureOptions& picture,
                       const ExecutionOptions& execution) {
  const RayCounters rays = result.counters.total();
  Json json;
  json["schema_version"] = 1;
  json["program"] = "Shoal " SHOAL_VERSION;
  json["options"] = options_json(result, scene, picture, execution);
  json["machine"] = machine_json();
  json["scene"] = {{"file", scene.file->path()},
                   {"file_bytes", scene.file->file_bytes()},
                   {"triangles_count", scene.header.triangles_count},
                   {"treelets_count", scene.treelets.size()},
                   {"instances_count", scene.top_tree.instance_count()},
                   {"geometry_bytes", scene.header.geometry_bytes},
                   {"builder", bvh_builder_name(static_cast<BvhBuilder>(scene.header.bvh_builder))},
                   {"position_bits", scene.header.position_bits},
                   {"position_step", scene.header.position_step},
                   {"position_error", scene.header.position_error},
                   {"resident_table_bytes", scene.resident_bytes()}};
  json["effects"] = Json::parse(effects_plan_json(effects_plan(scene, picture.shading.effects, effect_askers(picture))));
  json["memory"] = plan_json(result.plan);
  json["memory"]["peak_cache_bytes"] = result.peak_cache_bytes;
  json["memory"]["peak_rss_bytes"] = peak_resident_set_bytes();
  json["render_seconds"] = result.seconds;
  json["resumed_from"] = nullptr;
  if (result.resumed) {
    json["resumed_from"] = {{"samples_count", result.resumed->samples}, {"render_seconds", result.resumed->seconds}};
  }
  json["picture_share"] = result.picture_share;
  json["samples"] = {{"mean", result.samples.mean},
                     {"least", result.samples.least},
                     {"most", result.samples.most},
                     {"drawn_mean", result.samples.drawn_mean},
                     {"passes_count", result.samples.passes_count}};
  if (picture.noise.asked()) {
    const NoiseReached reached = result.noise.value_or(NoiseReached{});
    json["noise"] = {{"median", result.noise ? Json(reached.median) : Json(nullptr)},
                     {"percentile_95", result.noise ? Json(reached.percentile_95) : Json(nullptr)},
                     {"target_met", result.noise && reached.meets(picture.noise)}};
  }
  const auto first = [&](double FirstPicture::* member) {
    return result.first_picture ? Json((*result.first_picture).*member) : Json(nullptr);
  };
  json["first_picture_seconds"] = first(&FirstPicture::seconds);
  json["first_picture_pixel_share"] = first(&FirstPicture::pixel_share);
  json["previews_count"] = result.previews_count;
  json["preview_seconds"] = result.preview_seconds;
  json["threads_count"] = result.threads;
  json["phases"] = phases_json(result.phases);
  json["rays_per_second"] = static_cast<double>(rays.rays_traced_count) / result.seconds;
  json["counters"] = Json::parse(counters_json(result.counters));
  json["first_invalid"] = invalid_json(result.counters, picture.width);
  Json& units = json["counter_list"] = Json::array();
  for (const CounterInfo& info : counter_list()) {
    units.push_back({{"name", info.name}, {"unit", info.unit}, {"meaning", info.sentence}});
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<std::string> number_warnings(const RenderCounters& c, uint32_t width) {
  std::vector<std::string> warnings;
  if (c.invalid_samples_count > 0) {
    const uint64_t counts[] = {c.invalid_emission_count, c.invalid_environment_count, c.invalid_light_count,
                               c.invalid_surface_count,  c.invalid_bounce_count,      c.invalid_path_count};
    static_assert(std::size(counts) == kInvalidTermNames.size());
    std::string terms;
    for (size_t i = 0; i < std::size(counts); ++i) {
      if (counts[i] > 0) terms += fmt::format("{}{} {}", terms.empty() ? "" : ", ", kInvalidTermNames[i], counts[i]);
    }
    const InvalidPlace& at = c.first_invalid;
    warnings.push_back(fmt::format(
        "{} contributions were not finite and were dropped ({}); the first: {}, pixel ({}, {}), sample {}, vertex {}",
        c.invalid_samples_count, terms, kInvalidTermNames[static_cast<size_t>(at.term)], at.pixel % width,
        at.pixel / width, at.sample, at.bounce));
  }
  if (c.film_saturated_count > 0) {
    warnings.push_back(fmt::format("{} samples were brighter than {:.2g} and were clamped to it",
                                   c.film_saturated_count, Film::kMaxRadiance));
  }
  return warnings;
}

std::string traffic_table(const std::vector<TrafficColumn>& columns) {
  std::string text = fmt::format("{:<34}", "");
  const auto width = [](const TrafficColumn& column) { return std::max<size_t>(16, column.title.size() + 2); };
  for (const TrafficColumn& column : columns) text += fmt::format("{:>{}}", column.title, width(column));
  text += "\n";
  const auto row = [&](std::string_view name, auto&& value) {
    text += fmt::format("{:<34}", name);
    for (const TrafficColumn& column : columns) {
      text += fmt::format("{:>{}}", value(*column.result, column.result->counters, column.result->counters.total()),
                          width(column));
    }
    text += "\n";
  };
  using R = const RenderResult&;
  using C = const RenderCounters&;
  using T = const RayCounters&;
  const bool whole = std::all_of(columns.begin(), columns.end(),
                                 [](const TrafficColumn& column) { return column.result->picture_share == 1; });
  if (!whole) {
    row("of the picture (not scaled)", [](R r, C, T) { return fmt::format("{:.2f} %", 100 * r.picture_share); });
  }
  row("read from disk", [](R, C c, T) { return format_bytes(c.disk_read_bytes); });
  row("disk reads", [](R, C c, T) { return fmt::format("{}", c.disk_reads_count); });
  row("treelet loads from disk", [](R, C c, T) { return fmt::format("{}", c.treelet_loads_count); });
  row("rays a treelet load", [](R, C c, T t) {
    return fmt::format("{:.1f}", ratio(t.rays_traced_count, c.treelet_loads_count));
  });
  row("page bytes decoded", [](R, C c, T) { return format_bytes(c.decoded_bytes); });
  row("bytes from disk a ray", [](R, C c, T t) {
    return fmt::format("{:.1f}", ratio(c.disk_read_bytes, t.rays_traced_count));
  });
  row("page requests", [](R, C c, T) { return fmt::format("{}", c.page_requests_count); });
  row("page hits", [](R, C c, T) {
    return fmt::format("{:.2f} %", 100 * ratio(c.page_hits_count, c.page_requests_count));
  });
  row("treelets taken in hand", [](R, C c, T) { return fmt::format("{}", c.treelet_batches_count); });
  row("treelet bytes taken in hand", [](R, C c, T) { return format_bytes(c.treelet_visit_bytes); });
  row("ray visits a treelet in hand", [](R, C c, T) {
    return fmt::format("{:.1f}", ratio(c.treelet_visits_count, c.treelet_batches_count));
  });
  row("treelet visits a ray", [](R, C c, T t) {
    return fmt::format("{:.2f}", ratio(c.treelet_visits_count, t.rays_traced_count));
  });
  row("ray bytes through queues", [](R, C c, T) { return format_bytes(c.ray_moved_bytes); });
  row("path state bytes touched", [](R, C c, T) { return format_bytes(c.path_state_moved_bytes); });
  row("rays", [](R, C, T t) { return fmt::format("{}", t.rays_traced_count); });
  if (std::any_of(columns.begin(), columns.end(),
                  [](const TrafficColumn& column) { return column.result->counters.simd_lanes_count > 0; })) {
    row("lanes with work", [](R, C c, T) {
      if (c.simd_lanes_count == 0) return std::string("-");
      return fmt::format("{:.1f} %", 100 * ratio(c.simd_active_lanes_count, c.simd_lanes_count));
    });
  }
  row("page cache", [](R r, C, T) { return format_bytes(r.plan.cache_bytes); });
  row("seconds", [](R r, C, T) { return fmt::format("{:.2f}", r.seconds); });
  row("million rays a second", [](R r, C, T t) {
    return fmt::format("{:.3f}", static_cast<double>(t.rays_traced_count) / r.seconds * 1e-6);
  });
  const auto percent = [](double share) { return fmt::format("{:.1f} %", 100 * share); };
  row("time in routing", [&](R r, C, T) { return percent(r.phases.routing_share()); });
  for (size_t i = 0; i < kPhaseCount; ++i) {
    row(fmt::format("time in {}", kPhaseNames[i]), [&](R r, C, T) { return percent(r.phases.share(Phase(i))); });
  }
  return text;
}

}  // namespace shoal
