#include "engine/describe_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/effects.h"
#include "treelets/bvh_builder_kind.h"

namespace shoal {

namespace {

using Json = nlohmann::ordered_json;

/// Text from the file that does not parse is shown as nothing: it is for people only.
Json parsed(const std::string& text) {
  Json json = Json::parse(text, nullptr, false);
  return json.is_discarded() ? Json::object() : json;
}

std::string mebibytes(uint64_t bytes) { return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1 << 20)); }

void append_line(std::string& text, const char* name, const std::string& value) {
  text += fmt::format("{:<22}{}\n", name, value);
}

/// With the SAH cost of its trees (BuiltObject::sah_cost, summed over objects), as the build record has it.
std::string describe_builder(const SceneHeader& header, const Json& record) {
  std::string text(bvh_builder_name(static_cast<BvhBuilder>(header.bvh_builder)));
  if (record.contains("sah_cost") && record["sah_cost"].is_number()) {
    text += fmt::format(", SAH cost {:.1f}", record["sah_cost"].get<double>());
  }
  return text;
}

void append_pages(std::string& text, const char* name, uint64_t decoded, uint64_t stored) {
  append_line(text, name, fmt::format("{}, {} on disk", mebibytes(decoded), mebibytes(stored)));
}

}  // namespace

std::string describe_positions(const SceneHeader& header) {
  if (header.position_bits == 0) return "exact";
  if (header.position_step == 0) return fmt::format("exact: too small for {} bits", header.position_bits);
  return fmt::format("{} bits, steps of up to {:g}: no point moved by more than {:g} in space", header.position_bits,
                     header.position_step, header.position_error);
}

SceneDescription describe_scene(const Scene& scene) {
  SceneDescription d;
  d.file_bytes = scene.file->file_bytes();
  d.resident_bytes = scene.resident_bytes();
  d.triangles_count = scene.header.triangles_count;
  d.instanced_triangles_count = scene.header.instanced_triangles_count;
  d.degenerate_count = scene.header.degenerate_count;
  d.treelets_count = scene.treelets.size();
  d.instances_count = scene.top_tree.instance_count();
  d.top_nodes_count = scene.top_tree.nodes().size();
  for (const Instance& i : scene.top_tree.instances())
    d.objects_count = std::max<uint64_t>(d.objects_count, uint64_t{i.object} + 1);
  d.materials_count = scene.materials.size();
  d.textures_count = scene.textures.size();
  d.emitters_count = scene.emitters.size();
  d.lights_count = scene.lights.size();
  d.cameras_count = scene.cameras.size();
  for (const PageRecord& record : scene.file->records()) {
    switch (record.kind) {
      case PageKind::kTable:
        d.table_bytes += record.raw_bytes;
        break;
      case PageKind::kTreelet:
        d.geometry_bytes += record.raw_bytes, d.geometry_stored_bytes += record.stored_bytes;
        break;
      case PageKind::kAttributes:
        d.attribute_bytes += record.raw_bytes, d.attribute_stored_bytes += record.stored_bytes;
        break;
      case PageKind::kTexture:
        d.texture_bytes += record.raw_bytes, d.texture_stored_bytes += record.stored_bytes;
        break;
    }
  }
  const double triangles = static_cast<double>(std::max<uint64_t>(d.triangles_count, 1));
  d.geometry_bytes_per_triangle = static_cast<double>(d.geometry_bytes) / triangles;
  d.geometry_stored_bytes_per_triangle = static_cast<double>(d.geometry_stored_bytes) / triangles;
  d.attribute_bytes_per_triangle = static_cast<double>(d.attribute_bytes) / triangles;
  d.attribute_stored_bytes_per_triangle = static_cast<double>(d.attribute_stored_bytes) / triangles;
  return d;
}

std::string scene_description_text(const Scene& scene) {
  const SceneDescription d = describe_scene(scene);
  const SceneHeader& h = scene.header;
  const Json build = parsed(scene.build_record);
  std::string text;
  append_line(text, "file", fmt::format("{} ({})", scene.file->path(), mebibytes(d.file_bytes)));
  if (build.contains("source") && build["source"].is_string()) {
    append_line(text, "source", build["source"].get<std::string>());
  }
  append_line(text, "triangles",
              fmt::format("{} stored, {} with instances, {} degenerate left out", d.triangles_count,
                          d.instanced_triangles_count, d.degenerate_count));
  append_line(text, "objects", fmt::format("{} in {} instances", d.objects_count, d.instances_count));
  append_line(text, "treelets",
              fmt::format("{} of about {} KiB, the largest {} KiB", d.treelets_count, h.treelet_bytes >> 10,
                          (h.largest_treelet_bytes + 1023) >> 10));
  append_line(text, "builder", describe_builder(h, build));
  append_line(text, "positions", describe_positions(h));
  append_pages(text, "geometry", d.geometry_bytes, d.geometry_stored_bytes);
  append_pages(text, "attributes", d.attribute_bytes, d.attribute_stored_bytes);
  append_pages(text, "textures", d.texture_bytes, d.texture_stored_bytes);
  append_line(text, "bytes a triangle",
              fmt::format("{:.1f} geometry resident, {:.1f} on disk; attributes {:.1f} and {:.1f}",
                          d.geometry_bytes_per_triangle, d.geometry_stored_bytes_per_triangle,
                          d.attribute_bytes_per_triangle, d.attribute_stored_bytes_per_triangle));
  append_line(text, "always resident", mebibytes(d.resident_bytes));
  append_line(text, "materials", fmt::format("{}, with {} textures", d.materials_count, d.textures_count));
  append_line(text, "lights", fmt::format("{} emissive triangles, {} punctual", d.emitters_count, d.lights_count));
  append_line(text, "cameras", std::to_string(d.cameras_count));
  append_line(text, "bounds",
              fmt::format("({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g})", h.bounds_lo[0], h.bounds_lo[1],
                          h.bounds_lo[2], h.bounds_hi[0], h.bounds_hi[1], h.bounds_hi[2]));
  if (build.contains("options") && build["options"].contains("variant") && build["options"]["variant"].is_string()) {
    append_line(text, "variant", build["options"]["variant"].get<std::string>());
  }
  text += "\neffects plan\n" + effects_plan_text(effects_plan(scene, {}));
  return text;
}

std::string scene_description_json(const Scene& scene) {
  const SceneDescription d = describe_scene(scene);
  const SceneHeader& h = scene.header;
  Json json = {{"path", scene.file->path()},
               {"file_bytes", d.file_bytes},
               {"table_bytes", d.table_bytes},
               {"resident_bytes", d.resident_bytes},
               {"triangles_count", d.triangles_count},
               {"instanced_triangles_count", d.instanced_triangles_count},
               {"degenerate_count", d.degenerate_count},
               {"treelets_count", d.treelets_count},
               {"instances_count", d.instances_count},
               {"objects_count", d.objects_count},
               {"top_nodes_count", d.top_nodes_count},
               {"materials_count", d.materials_count},
               {"textures_count", d.textures_count},
               {"emitters_count", d.emitters_count},
               {"lights_count", d.lights_count},
               {"cameras_count", d.cameras_count},
               {"geometry_bytes", d.geometry_bytes},
               {"geometry_stored_bytes", d.geometry_stored_bytes},
               {"attribute_bytes", d.attribute_bytes},
               {"attribute_stored_bytes", d.attribute_stored_bytes},
               {"texture_bytes", d.texture_bytes},
               {"texture_stored_bytes", d.texture_stored_bytes},
               {"geometry_bytes_per_triangle", d.geometry_bytes_per_triangle},
               {"geometry_stored_bytes_per_triangle", d.geometry_stored_bytes_per_triangle},
               {"attribute_bytes_per_triangle", d.attribute_bytes_per_triangle},
               {"attribute_stored_bytes_per_triangle", d.attribute_stored_bytes_per_triangle},
               {"largest_treelet_bytes", h.largest_treelet_bytes},
               {"builder", bvh_builder_name(static_cast<BvhBuilder>(h.bvh_builder))},
               {"position_bits", h.position_bits},
               {"position_step", h.position_step},
               {"position_error", h.position_error},
               {"bounds_lo", h.bounds_lo},
               {"bounds_hi", h.bounds_hi},
               {"names", parsed(scene.names)},
               {"build", parsed(scene.build_record)}};
  json["effects"] = Json::parse(effects_plan_json(effects_plan(scene, {})));
  return json.dump(2, ' ', false, Json::error_handler_t::replace);
}

}  // namespace shoal
