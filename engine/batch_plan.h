// What a batch is going to do: the scenes, where their pictures go, the options of each and the command that renders it.
// Nothing is written and no scene is read. Called by engine/batch_run and bins/command_batch.
// Thread rule: plain values. Cost: reads folders and every shoal.json.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/batch_options.h"
#include "io/file.h"
#include "io/result.h"

namespace shoal {

struct BatchOptions {
  std::string folder, out;           ///< absolute
  std::vector<std::string> include, exclude;
  RenderOptions common;              ///< of scenes that do not say otherwise
  RenderOptions forced;              ///< of every scene, whatever it says
  uint64_t max_memory_bytes = 0;     ///< of all processes together; 0: default_cap_bytes()
  unsigned jobs = 1, threads = 0;    ///< threads of all together; 0: as many as the machine has
  bool keep_built = false;           ///< the .shoal of each glTF
  std::string cache_folder;          ///< where they are kept; empty: in `out`
  bool force = false;                ///< renders again what is done
  std::string program;               ///< that renders
};

struct BatchScene {
  std::string scene;   ///< path from the folder
  std::string output;  ///< path from `out` without .exr and the like; no two scenes have the same
  std::string id;      ///< of `output`: names its files among those of the batch
  RenderOptions options;
  std::optional<Error> error;  ///< it cannot be rendered: its shoal.json is wrong
};

struct BatchPlan {
  std::vector<BatchScene> scenes;
  std::vector<std::string> unreadable;  ///< folders: one sentence each
};

/// Fails with: kInput (no folder, no scenes), kUsage (patterns, `out` is the folder of the scenes).
Result<BatchPlan> plan_batch(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules);

/// `scenes` sorted and all different. Of a scene "a/b.gltf" it is "a/b", or "a/b.gltf" where another scene would write the
/// same.
std::vector<std::string> output_names(const std::vector<std::string>& scenes);

/// Where things are.
struct BatchPaths {
  explicit BatchPaths(std::string out_folder) : out(std::move(out_folder)), state(out + "/.batch") {}
  std::string out, state;

  std::string picture(const BatchScene& s) const { return out + "/" + s.output + ".exr"; }
  std::string png(const BatchScene& s) const { return out + "/" + s.output + ".png"; }
  std::string stats(const BatchScene& s) const { return out + "/" + s.output + ".stats.json"; }
  std::string checkpoint(const BatchScene& s) const { return picture(s) + ".checkpoint"; }  ///< of `shoal render`
  std::string folder(const BatchScene& s) const;  ///< of these four
  std::string record(const BatchScene& s) const { return state + "/records/" + s.id + ".json"; }
  std::string log(const BatchScene& s) const { return state + "/logs/" + s.id + ".log"; }
  std::string thumbnail(const BatchScene& s) const { return state + "/thumbnails/" + s.id + ".png"; }
  std::string built(const BatchScene& s) const { return state + "/built/" + s.id; }
  std::string lock() const { return state + "/lock"; }
  std::string asked() const { return state + "/batch.json"; }
  std::string summary() const { return out + "/summary.json"; }
  std::string page() const { return out + "/summary.html"; }
};

/// What one render may use; 0: its own choice.
struct BatchShare {
  uint64_t memory_bytes = 0;
  unsigned threads = 0;
};

/// What a render that begins now gets of what is left of the budget: an even part for each that could begin. Every one has
/// at least one thread. Requires: starting > 0.
BatchShare next_share(const BatchShare& left, unsigned starting);

/// `shoal render` of the scene, word by word.
std::vector<std::string> render_command(const BatchOptions& options, const RenderOptionRules& rules,
                                        const BatchScene& scene, const BatchShare& share);
/// The same for a shell, on one line, with the folders that it needs.
std::string render_line(const BatchOptions& options, const RenderOptionRules& rules, const BatchScene& scene,
                        const BatchShare& share);

}  // namespace shoal
