#include "engine/batch_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "engine/batch_text.h"
#include "engine/find_scenes.h"
#include "io/content_hash.h"

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

/// Of renders that do not say otherwise: what a machine that fails costs at most.
constexpr const char* kCheckpointEvery = "every=10m";

std::string folder_of(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

std::string name_of(const std::string& path) { return path.substr(path.rfind('/') + 1); }

/// The shoal.json of every folder, each read once.
class AllFolderOptions {
 public:
  AllFolderOptions(FileSystem& fs, const BatchOptions& batch, const RenderOptionRules& rules, const FoundScenes& found)
      : fs_(fs), batch_(batch), rules_(rules) {
    for (const FoundScene& scene : found.scenes) names_[folder_of(scene.path)].insert(escape_name(name_of(scene.path)));
  }

  /// Of one scene, under what the command line says.
  Result<RenderOptions> of(const std::string& scene) {
    const std::string folder = folder_of(scene);
    auto at = read_.find(folder);
    if (at == read_.end()) at = read_.emplace(folder, read(folder)).first;
    if (!at->second.ok()) return at->second.error();
    const FolderOptions& options = at->second.value();
    RenderOptions merged = merge_options(batch_.common, options.defaults);
    const auto own = options.scenes.find(escape_name(name_of(scene)));
    if (own != options.scenes.end()) merged = merge_options(merged, own->second);
    return merge_options(merged, batch_.forced);
  }

 private:
  Result<FolderOptions> read(const std::string& folder) {
    const std::string file = batch_.folder + "/" + (folder.empty() ? "" : folder + "/") + kFolderOptionsName;
    std::error_code error;
    if (stdfs::symlink_status(file, error).type() == stdfs::file_type::not_found) return FolderOptions{};
    SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(fs_, file, kMaxFolderOptionsBytes));
    SHOAL_ASSIGN_OR_RETURN(FolderOptions options, parse_folder_options(text, file, rules_));
    for (const auto& [name, scene] : options.scenes) {
      if (names_[folder].contains(name)) continue;
      return Error{ErrorCode::kInput, fmt::format("{}: scenes[\"{}\"]: expected the name of a scene beside it, found none "
                                                  "of that name", file, escape_name(name))};
    }
    return options;
  }

  FileSystem& fs_;
  const BatchOptions& batch_;
  const RenderOptionRules& rules_;
  std::map<std::string, std::set<std::string>> names_;
  std::map<std::string, Result<FolderOptions>> read_;
};

bool same_folder(const std::string& a, const std::string& b) {
  std::error_code error;
  return stdfs::equivalent(a, b, error) || stdfs::path(a).lexically_normal() == stdfs::path(b).lexically_normal();
}

std::string id_of(const std::string& output) {
  ContentHash hash;
  hash.add_text(output);
  return fmt::format("{:016x}", hash.value());
}

}  // namespace

std::vector<std::string> output_names(const std::vector<std::string>& scenes) {
  std::vector<std::string> names;
  for (const std::string& scene : scenes) names.push_back(scene.substr(0, scene.rfind('.')));
  // A name that is changed may be another's: until nothing changes, which is soon, for each changes once at most.
  for (bool changed = true; changed;) {
    changed = false;
    std::map<std::string, size_t> counts;
    for (const std::string& name : names) ++counts[name];
    for (size_t i = 0; i < names.size(); ++i) {
      if (counts[names[i]] < 2 || names[i] == scenes[i]) continue;
      names[i] = scenes[i];
      changed = true;
    }
  }
  return names;
}

Result<BatchPlan> plan_batch(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules) {
  if (same_folder(options.folder, options.out)) {
    return Error{ErrorCode::kUsage, fmt::format("--out {}: pictures cannot go into the folder of the scenes, where they "
                                                "might replace textures", escape_name(options.out))};
  }
  SHOAL_ASSIGN_OR_RETURN(FoundScenes found,
                         find_scenes({options.folder, options.include, options.exclude, options.out}));
  std::vector<std::string> paths;
  for (const FoundScene& scene : found.scenes) paths.push_back(scene.path);
  const std::vector<std::string> names = output_names(paths);
  AllFolderOptions folders(fs, options, rules, found);
  BatchPlan plan;
  plan.unreadable = std::move(found.unreadable);
  for (size_t i = 0; i < paths.size(); ++i) {
    if (!found.scenes[i].chosen) continue;
    BatchScene scene{paths[i], names[i], id_of(names[i]), {}, std::nullopt};
    auto asked = folders.of(paths[i]);
    if (asked.ok()) {
      scene.options = std::move(asked).value();
    } else {
      scene.error = std::move(asked).error();
    }
    plan.scenes.push_back(std::move(scene));
  }
  if (plan.scenes.empty()) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected scenes (.gltf, .glb, .shoal) below it, found {}",
                                                escape_name(options.folder),
                                                paths.empty() ? "none" : "none that the patterns leave")};
  }
  return plan;
}

std::string BatchPaths::folder(const BatchScene& s) const {
  const std::string inside = folder_of(s.output);
  return inside.empty() ? out : out + "/" + inside;
}

BatchShare next_share(const BatchShare& left, unsigned starting) {
  SHOAL_CHECK(starting > 0);
  return {left.memory_bytes / starting, std::max(left.threads / starting, 1u)};
}

std::vector<std::string> render_command(const BatchOptions& options, const RenderOptionRules& rules,
                                        const BatchScene& scene, const BatchShare& share) {
  const BatchPaths paths(options.out);
  std::vector<std::string> words = {options.program, "render", options.folder + "/" + scene.scene,
                                    "-o", paths.picture(scene), "--png", paths.png(scene),
                                    "--stats", paths.stats(scene)};
  const bool is_built = is_shoal_path(scene.scene);
  if (!is_built) {
    words.insert(words.end(), {"--cache-dir", options.cache_folder.empty() ? paths.built(scene) : options.cache_folder});
  }
  if (!is_built && !options.keep_built) words.push_back("--discard-built");
  words.push_back("--resume");
  if (!scene.options.contains("checkpoint")) words.insert(words.end(), {"--checkpoint", kCheckpointEvery});
  if (share.memory_bytes > 0) words.insert(words.end(), {"--max-memory", std::to_string(share.memory_bytes)});
  if (share.threads > 0) words.insert(words.end(), {"--threads", std::to_string(share.threads)});
  for (std::string& word : option_words(scene.options, rules)) words.push_back(std::move(word));
  return words;
}

std::string render_line(const BatchOptions& options, const RenderOptionRules& rules, const BatchScene& scene,
                        const BatchShare& share) {
  // With /. behind it the folder's name does not end the word: see shell_quote().
  return "mkdir -p " + shell_quote(BatchPaths(options.out).folder(scene) + "/.") + " && " +
         shell_line(render_command(options, rules, scene, share));
}

}  // namespace shoal
