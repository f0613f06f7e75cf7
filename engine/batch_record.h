// What a batch remembers of a scene: one JSON file a scene (docs/batch.md), written whole and synced before a render
// begins and after it ended. Called by engine/batch_run and engine/batch_summary. Thread rule: plain values.
// Cost: one small file a change.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene_content.h"
#include "io/file.h"
#include "io/result.h"

namespace shoal {

enum class SceneState : uint8_t {
  kWaiting,  ///< never begun; not on disk
  kStarted,  ///< being rendered, or its render ended unseen: what lies under the names of its outputs says nothing
  kDone,
  kFailed,
};

/// From the --stats of a render.
struct SceneFigures {
  double render_seconds = 0;
  uint64_t disk_read_bytes = 0;  ///< by the render, not by the build before it
  uint64_t rays_count = 0;
  uint64_t peak_rss_bytes = 0;
  uint64_t width = 0, height = 0, samples = 0, triangles_count = 0;
  std::string order;
  std::vector<std::string> effects;  ///< simulated
};

struct SceneRecord {
  std::string scene;   ///< path from the batch's folder
  std::string output;  ///< the same of its pictures, without .exr and the like
  uint64_t key = 0;    ///< of scene, options and program; 0: it changed meanwhile
  SceneState state = SceneState::kWaiting;
  int exit_code = -1;  ///< of the render; 128 + n: ended by signal n
  std::string message;  ///< why it failed, in one line
  std::vector<std::string> options;  ///< words of the command line
  double seconds = 0;                ///< from start to end of its process, the build included
  double processor_seconds = 0;
  uint64_t max_memory_bytes = 0;
  unsigned threads = 0;
  bool alone = false;  ///< with the whole budget, because its share did not suffice
  uint64_t process_peak_rss_bytes = 0, process_disk_read_bytes = 0, process_disk_written_bytes = 0;
  int64_t ended_unix_seconds = 0;
  std::vector<uint64_t> output_bytes;  ///< of the picture, its PNG and its statistics
  SceneFigures figures;
  SceneContent content;
};

/// Null where there is none, or none that can be read: the scene is rendered again then.
std::optional<SceneRecord> read_record(FileSystem& fs, const std::string& path);
/// Fails with: kStorage.
Status write_record(FileSystem& fs, const std::string& path, const SceneRecord& record);

/// Fails with: kInput (missing, or not what a render writes), kStorage.
Result<SceneFigures> read_figures(FileSystem& fs, const std::string& stats_path);

/// "waiting", "started", "done", "failed".
const char* state_name(SceneState state);

}  // namespace shoal
