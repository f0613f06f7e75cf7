#include "engine/picture_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <vector>

#include "engine/accuracy_names.h"
#include "engine/build_record.h"
#include "io/content_hash.h"

namespace shoal {
namespace {

constexpr uint64_t kHashBlockBytes = 1u << 20;

/// Whoever adds an option to one of these adds a line below.
static_assert(sizeof(ShadingOptions) == 112 && sizeof(EnvironmentOptions) == 64 && sizeof(LensOptions) == 80);

class Lines {
 public:
  template <class T>
  void add(std::string_view name, const T& value) {
    text_ += fmt::format("{} {}\n", name, value);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

Result<uint64_t> hash_file(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kDirect));
  ContentHash hash;
  std::vector<std::byte> block(std::min(file->size_bytes(), kHashBlockBytes));
  for (uint64_t at = 0; at < file->size_bytes(); at += block.size()) {
    const auto part = std::span(block).first(std::min<uint64_t>(block.size(), file->size_bytes() - at));
    SHOAL_RETURN_IF_ERROR(file->read_at(at, part));
    hash.add(part);
  }
  return hash.value();
}

void add_lens(const LensOptions& lens, Lines& lines) {
  lines.add("projection", static_cast<int>(lens.projection));
  lines.add("fov", lens.fov_degrees);
  lines.add("ortho-height", lens.height);
  lines.add("aperture", lens.aperture);
  lines.add("f-stop", lens.f_stop);
  lines.add("focus", lens.focus_distance);
  lines.add("distortion",
            fmt::format("{}:{}", static_cast<int>(lens.distortion.model), fmt::join(lens.distortion.k, ",")));
}

Status add_environment(FileSystem& fs, const ShadingOptions& shading, Lines& lines) {
  const EnvironmentOptions& sky = shading.environment;
  std::string light = "none";
  if (sky.kind == EnvironmentOptions::Kind::kConstant) {
    light = fmt::format("constant:{},{},{}", sky.radiance.x, sky.radiance.y, sky.radiance.z);
  } else if (sky.kind == EnvironmentOptions::Kind::kImage && (shading.effects.off & kEffectEnvironment) == 0) {
    SHOAL_ASSIGN_OR_RETURN(const uint64_t hash, hash_file(fs, sky.path));
    light = fmt::format("file:{:016x}", hash);
  }
  lines.add("environment", light);
  lines.add("environment-rotation", sky.rotation);
  lines.add("environment-intensity", sky.intensity);
  return {};
}

void add_shading(const ShadingOptions& shading, Lines& lines) {
  lines.add("bounces", shading.bounces);
  lines.add("roulette-start", shading.roulette_start);
  lines.add("clamp-direct", shading.clamp_direct);
  lines.add("clamp-indirect", shading.clamp_indirect);
  lines.add("sampler", sampler_name(shading.sampler));
  lines.add("seed", shading.seed);
  lines.add("light-choice", light_choice_name(shading.light_choice));
  lines.add("effects-off", fmt::format("{:x}", shading.effects.off));
  lines.add("texture-filter", texture_filter_name(shading.texture_filter));
  lines.add("triangle-test", name_in(kTriangleTests, shading.triangle_test));
}

std::map<std::string, std::string> values_by_name(const std::string& text) {
  std::map<std::string, std::string> values;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const size_t space = std::min(text.find(' ', begin), end);
    values[text.substr(begin, space - begin)] =
        text.substr(std::min(space + 1, end), end - std::min(space + 1, end));
    begin = end + 1;
  }
  return values;
}

}  // namespace

Result<std::string> picture_identity(FileSystem& fs, const Scene& scene, const PictureOptions& picture) {
  ContentHash directory;
  directory.add(std::as_bytes(scene.file->records()));
  // What may be added without a new file: a lamp at the camera of a scene without light
  // (engine/light_unlit_scene.h).
  directory.add(std::as_bytes(std::span(scene.lights)));
  Lines lines;
  lines.add("program", SHOAL_VERSION);
  lines.add("scene", fmt::format("{:016x}", scene.header.content_hash));
  lines.add("file", fmt::format("{:016x}", directory.value()));
  lines.add("width", picture.width);
  lines.add("height", picture.height);
  lines.add("camera", picture.camera);
  add_lens(picture.lens, lines);
  lines.add("target-noise", fmt::format("{}:{}", picture.noise.median, picture.noise.percentile_95));
  lines.add("tile-sample", picture.tile_sample);
  lines.add("aov", fmt::format("{}", fmt::join(aov_names(picture.aovs), ",")));
  add_shading(picture.shading, lines);
  SHOAL_RETURN_IF_ERROR(add_environment(fs, picture.shading, lines));
  return lines.take();
}

std::string identity_difference(const std::string& expected, const std::string& found) {
  const auto wanted = values_by_name(expected), there = values_by_name(found);
  std::vector<std::string> parts;
  for (const auto& [name, value] : wanted) {
    const auto at = there.find(name);
    const std::string other = at == there.end() ? "" : at->second;
    if (other == value) continue;
    parts.push_back(fmt::format("{} is {}, not {}", name, other.empty() ? "nothing" : other,
                                value.empty() ? "nothing" : value));
  }
  if (parts.empty() && expected != found) parts.push_back("it says more than is known here");
  return fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace shoal
