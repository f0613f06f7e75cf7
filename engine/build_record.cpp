#include "engine/build_record.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <bit>
#include <filesystem>
#include <nlohmann/json.hpp>

namespace shoal {

namespace {

using Json = nlohmann::ordered_json;

/// Bytes that are not UTF-8 are replaced: names come from the file.
std::string dump(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace); }

class SourceHash {
 public:
  explicit SourceHash(uint64_t seed) : words_{seed} {}
  void add(uint64_t word) { words_.push_back(word); }
  uint64_t value() const { return XXH3_64bits(words_.data(), words_.size() * sizeof(uint64_t)); }

 private:
  std::vector<uint64_t> words_;
};

}  // namespace

uint64_t source_hash(const SourceFiles& sources, bool modification_times) {
  SourceHash hash(sources.json_hash());
  for (const SourceFile& file : sources.files()) {
    hash.add(file.missing ? ~uint64_t{0} : file.bytes);
    if (modification_times) hash.add(static_cast<uint64_t>(file.modified_ns));
  }
  return hash.value();
}

Result<uint64_t> build_cache_key(FileSystem& fs, const std::string& gltf_path, const SceneBuildOptions& options) {
  SourceFiles sources(fs);
  SHOAL_RETURN_IF_ERROR(sources.add_document(gltf_path));
  SHOAL_ASSIGN_OR_RETURN(const gltf::Document document, gltf::load_document(fs, gltf_path, options.limits));
  SHOAL_RETURN_IF_ERROR(sources.add_parts(document));
  SourceHash hash(source_hash(sources, true));
  hash.add(options.treelet_bytes);
  hash.add(static_cast<uint64_t>(options.positions));
  hash.add(static_cast<uint64_t>(options.builder));
  SHOAL_ASSIGN_OR_RETURN(const auto pose, choose_pose(document, options.pose));
  if (pose) hash.add(pose->animation), hash.add(std::bit_cast<uint64_t>(pose->time + 0.0));
  if (pose && pose->has_shutter()) {
    hash.add(std::bit_cast<uint64_t>(pose->open + 0.0)), hash.add(std::bit_cast<uint64_t>(pose->close + 0.0));
  }
  hash.add(kSceneVersion);
  if (!options.variant.empty()) hash.add(XXH3_64bits(options.variant.data(), options.variant.size()));
  hash.add(XXH3_64bits(kBuilderVersion, std::char_traits<char>::length(kBuilderVersion)));
  return hash.value();
}

std::string build_record_json(const gltf::Document& document, const SceneHeader& header,
                              const SceneBuildReport& report, const std::optional<ChosenPose>& pose,
                              const std::string& variant) {
  Json json;
  json["shoal_version"] = kBuilderVersion;
  json["scene_version"] = header.version;
  json["source"] = std::filesystem::path(document.path).filename().string();
  json["content_hash"] = fmt::format("{:016x}", header.content_hash);
  json["options"] = {{"treelet_bytes", header.treelet_bytes},
                     {"builder", bvh_builder_name(static_cast<BvhBuilder>(header.bvh_builder))},
                     {"positions", position_precision_name(static_cast<PositionPrecision>(header.position_bits))}};
  if (!variant.empty()) json["options"]["variant"] = variant;
  if (pose) {
    json["options"]["animation"] = pose->animation;
    json["options"]["animation_name"] = pose->name;
    json["options"]["time"] = pose->time;
    if (pose->shutter) json["options"]["shutter"] = *pose->shutter;
  }
  json["triangles_count"] = header.triangles_count;
  json["instanced_triangles_count"] = header.instanced_triangles_count;
  json["degenerate_count"] = header.degenerate_count;
  json["zero_area_count"] = report.zero_area_count;
  json["objects_count"] = report.objects_count;
  json["instances_count"] = report.instances_count;
  json["treelets_count"] = report.treelets_count;
  json["position_step"] = header.position_step;
  json["position_error"] = header.position_error;
  json["sah_cost"] = report.sah_cost;
  json["warnings"] = report.warnings;
  return dump(json);
}

std::string names_json(const gltf::Document& document, const FlatScene& scene, bool default_material) {
  Json materials = Json::array(), cameras = Json::array(), lights = Json::array();
  for (const gltf::Material& material : document.materials) materials.push_back(material.name);
  if (default_material) materials.push_back("(default)");
  for (const PlacedItem& item : scene.cameras) cameras.push_back(document.cameras[item.index].name);
  for (const PlacedItem& item : scene.lights) lights.push_back(document.lights[item.index].name);
  return dump({{"materials", materials}, {"cameras", cameras}, {"lights", lights}});
}

}  // namespace shoal
