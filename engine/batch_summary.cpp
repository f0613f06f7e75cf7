#include "engine/batch_summary.h"

#include <nlohmann/json.hpp>

#include "engine/batch_text.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

Json entry_json(const BatchPaths& paths, const BatchEntry& entry) {
  const SceneRecord& r = entry.record;
  const bool done = r.state == SceneState::kDone;
  const auto inside = [&](const std::string& path) { return escape_name(path.substr(paths.out.size() + 1)); };
  Json json = {{"scene", escape_name(entry.scene.scene)},
               {"state", state_name(r.state)},
               {"skipped", entry.skipped},
               {"exit_code", r.state == SceneState::kDone || r.state == SceneState::kFailed ? Json(r.exit_code) : Json()},
               {"message", escape_name(r.message)}};
  if (done) {
    json["picture"] = inside(paths.picture(entry.scene));
    json["png"] = inside(paths.png(entry.scene));
    json["stats"] = inside(paths.stats(entry.scene));
  }
  json["log"] = inside(paths.log(entry.scene));
  Json& options = json["options"] = Json::object();
  for (const auto& [name, value] : entry.scene.options) options[escape_name(name)] = escape_name(value);
  json["seconds"] = r.seconds;
  json["processor_seconds"] = r.processor_seconds;
  json["max_memory_bytes"] = r.max_memory_bytes;
  json["threads_count"] = r.threads;
  json["alone"] = r.alone;
  json["process_peak_rss_bytes"] = r.process_peak_rss_bytes;
  json["process_disk_read_bytes"] = r.process_disk_read_bytes;
  json["process_disk_written_bytes"] = r.process_disk_written_bytes;
  if (!done) return json;
  const SceneFigures& f = r.figures;
  json["render_seconds"] = f.render_seconds;
  json["disk_read_bytes"] = f.disk_read_bytes;
  json["rays_count"] = f.rays_count;
  json["peak_rss_bytes"] = f.peak_rss_bytes;
  json["width"] = f.width;
  json["height"] = f.height;
  json["samples_per_pixel"] = f.samples;
  json["triangles_count"] = f.triangles_count;
  json["order"] = f.order;
  json["effects"] = f.effects;
  return json;
}

Json standing_json(const BatchStanding& standing) {
  const BatchPaths paths(standing.options->out);
  const BatchCounts counts = standing.counts();
  Json json = {{"schema_version", 1},
               {"program", "Shoal " SHOAL_VERSION},
               {"folder", escape_name(standing.options->folder)},
               {"state", standing.state},
               {"seconds", standing.seconds},
               {"jobs_count", standing.options->jobs},
               {"max_memory_bytes", standing.max_memory_bytes},
               {"threads_count", standing.threads},
               {"scenes_count", counts.scenes},
               {"done_count", counts.done},
               {"skipped_count", counts.skipped},
               {"failed_count", counts.failed},
               {"left_count", counts.left},
               {"unreadable_folders", Json::array()},
               {"scenes", Json::array()}};
  for (const std::string& sentence : standing.unreadable) json["unreadable_folders"].push_back(escape_name(sentence));
  for (const BatchEntry& entry : standing.entries) json["scenes"].push_back(entry_json(paths, entry));
  return json;
}

}  // namespace

BatchCounts BatchStanding::counts() const {
  BatchCounts counts;
  counts.scenes = entries.size();
  for (const BatchEntry& entry : entries) {
    const bool done = entry.record.state == SceneState::kDone, failed = entry.record.state == SceneState::kFailed;
    counts.done += done && !entry.skipped;
    counts.skipped += done && entry.skipped;
    counts.failed += failed;
    counts.left += !done && !failed;
  }
  return counts;
}

Status write_summary(FileSystem& fs, const BatchStanding& standing) {
  const std::string text = standing_json(standing).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
  const BatchPaths paths(standing.options->out);
  SHOAL_RETURN_IF_ERROR(write_whole_file(fs, paths.summary(), std::as_bytes(std::span(text))));
  return write_summary_page(fs, standing);
}

}  // namespace shoal
