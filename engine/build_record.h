// What a .shoal file says of its own making, and what a build depends on. No clock and no path of the machine: the same
// source, options and cap (which sets the chunks) give the same bytes. Called by engine/build_scene and
// engine/open_scene's readers.
#pragma once

#include <string>
#include <vector>

#include "engine/build_scene.h"
#include "engine/flatten_nodes.h"
#include "engine/scene_tables.h"
#include "engine/source_files.h"

namespace shoal {

inline constexpr const char* kBuilderVersion = "0.1.0";
inline constexpr uint32_t kSceneVersion = SceneHeader{}.version;

/// Hash of the JSON and of the sizes of the files it names; with `modification_times` of those too. A file that is
/// missing counts as such.
uint64_t source_hash(const SourceFiles& sources, bool modification_times);

std::string build_record_json(const gltf::Document& document, const SceneHeader& header,
                              const SceneBuildReport& report, const std::optional<ChosenPose>& pose,
                              const std::string& variant);
/// `lights` and `cameras` in the order of their tables.
std::string names_json(const gltf::Document& document, const FlatScene& scene, bool default_material);

}  // namespace shoal
