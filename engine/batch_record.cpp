#include "engine/batch_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "engine/batch_text.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchemaVersion = 1;
constexpr uint64_t kMaxRecordBytes = 64u << 20;
constexpr uint64_t kMaxStatsBytes = 256u << 20;
constexpr const char* kStateNames[] = {"waiting", "started", "done", "failed"};

std::string hex(uint64_t value) { return fmt::format("{:016x}", value); }
uint64_t from_hex(const Json& json) { return std::stoull(json.get<std::string>(), nullptr, 16); }

Json content_json(const SceneContent& content) {
  Json files = Json::array();
  for (const HashedFile& file : content.files) {
    files.push_back({{"path", escape_name(file.path)},
                     {"missing", file.missing},
                     {"bytes", file.bytes},
                     {"modified_ns", file.modified_ns},
                     {"hash", hex(file.hash)}});
  }
  return {{"hash", hex(content.hash)}, {"looked_ns", content.looked_ns}, {"files", files}};
}

SceneContent content_of(const Json& json) {
  SceneContent content;
  content.hash = from_hex(json.at("hash"));
  content.looked_ns = json.at("looked_ns").get<int64_t>();
  for (const Json& file : json.at("files")) {
    content.files.push_back({unescape_name(file.at("path").get<std::string>()), file.at("missing").get<bool>(),
                             file.at("bytes").get<uint64_t>(), file.at("modified_ns").get<int64_t>(),
                             from_hex(file.at("hash"))});
  }
  return content;
}

Json figures_json(const SceneFigures& f) {
  return {{"render_seconds", f.render_seconds},
          {"disk_read_bytes", f.disk_read_bytes},
          {"rays_count", f.rays_count},
          {"peak_rss_bytes", f.peak_rss_bytes},
          {"width", f.width},
          {"height", f.height},
          {"samples_per_pixel", f.samples},
          {"triangles_count", f.triangles_count},
          {"order", f.order},
          {"effects", f.effects}};
}

SceneFigures figures_of(const Json& json) {
  SceneFigures f;
  f.render_seconds = json.at("render_seconds").get<double>();
  f.disk_read_bytes = json.at("disk_read_bytes").get<uint64_t>();
  f.rays_count = json.at("rays_count").get<uint64_t>();
  f.peak_rss_bytes = json.at("peak_rss_bytes").get<uint64_t>();
  f.width = json.at("width").get<uint64_t>();
  f.height = json.at("height").get<uint64_t>();
  f.samples = json.at("samples_per_pixel").get<uint64_t>();
  f.triangles_count = json.at("triangles_count").get<uint64_t>();
  f.order = json.at("order").get<std::string>();
  f.effects = json.at("effects").get<std::vector<std::string>>();
  return f;
}

std::vector<std::string> each(const std::vector<std::string>& texts, std::string (*change)(std::string_view)) {
  std::vector<std::string> changed;
  for (const std::string& text : texts) changed.push_back(change(text));
  return changed;
}

Json record_json(const SceneRecord& r) {
  return {{"schema_version", kSchemaVersion},
          {"scene", escape_name(r.scene)},
          {"output", escape_name(r.output)},
          {"key", hex(r.key)},
          {"state", state_name(r.state)},
          {"exit_code", r.exit_code},
          {"message", escape_name(r.message)},
          {"options", each(r.options, escape_name)},
          {"seconds", r.seconds},
          {"processor_seconds", r.processor_seconds},
          {"max_memory_bytes", r.max_memory_bytes},
          {"threads_count", r.threads},
          {"alone", r.alone},
          {"process_peak_rss_bytes", r.process_peak_rss_bytes},
          {"process_disk_read_bytes", r.process_disk_read_bytes},
          {"process_disk_written_bytes", r.process_disk_written_bytes},
          {"ended_unix_seconds", r.ended_unix_seconds},
          {"output_bytes", r.output_bytes},
          {"figures", figures_json(r.figures)},
          {"content", content_json(r.content)}};
}

/// Throws what nlohmann-json throws, and of a state that is none of ours.
SceneRecord record_of(const Json& json) {
  SceneRecord r;
  const auto state = std::find(std::begin(kStateNames), std::end(kStateNames), json.at("state").get<std::string>());
  if (json.at("schema_version") != kSchemaVersion || state == std::end(kStateNames)) throw std::invalid_argument("record");
  r.scene = unescape_name(json.at("scene").get<std::string>());
  r.output = unescape_name(json.at("output").get<std::string>());
  r.key = from_hex(json.at("key"));
  r.state = static_cast<SceneState>(state - std::begin(kStateNames));
  r.exit_code = json.at("exit_code").get<int>();
  r.message = unescape_name(json.at("message").get<std::string>());
  r.options = each(json.at("options").get<std::vector<std::string>>(), unescape_name);
  r.seconds = json.at("seconds").get<double>();
  r.processor_seconds = json.at("processor_seconds").get<double>();
  r.max_memory_bytes = json.at("max_memory_bytes").get<uint64_t>();
  r.threads = json.at("threads_count").get<unsigned>();
  r.alone = json.at("alone").get<bool>();
  r.process_peak_rss_bytes = json.at("process_peak_rss_bytes").get<uint64_t>();
  r.process_disk_read_bytes = json.at("process_disk_read_bytes").get<uint64_t>();
  r.process_disk_written_bytes = json.at("process_disk_written_bytes").get<uint64_t>();
  r.ended_unix_seconds = json.at("ended_unix_seconds").get<int64_t>();
  r.output_bytes = json.at("output_bytes").get<std::vector<uint64_t>>();
  r.figures = figures_of(json.at("figures"));
  r.content = content_of(json.at("content"));
  return r;
}

}  // namespace

const char* state_name(SceneState state) { return kStateNames[static_cast<size_t>(state)]; }

std::optional<SceneRecord> read_record(FileSystem& fs, const std::string& path) {
  const auto text = read_whole_file(fs, path, kMaxRecordBytes);
  if (!text.ok()) return std::nullopt;
  try {
    return record_of(Json::parse(text.value()));
  } catch (const std::exception&) {  // of nlohmann-json, or of a number that is none
    return std::nullopt;
  }
}

Status write_record(FileSystem& fs, const std::string& path, const SceneRecord& record) {
  const std::string text = record_json(record).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
  return write_whole_file(fs, path, std::as_bytes(std::span(text)));
}

Result<SceneFigures> read_figures(FileSystem& fs, const std::string& stats_path) {
  SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(fs, stats_path, kMaxStatsBytes));
  try {
    const Json json = Json::parse(text);
    const Json& options = json.at("options");
    const Json& counters = json.at("counters").at("totals");
    SceneFigures f;
    f.render_seconds = json.at("render_seconds").get<double>();
    f.disk_read_bytes = counters.at("disk_read_bytes").get<uint64_t>();
    f.rays_count = counters.at("rays_traced_count").get<uint64_t>();
    f.peak_rss_bytes = json.at("memory").at("peak_rss_bytes").get<uint64_t>();
    f.width = options.at("width").get<uint64_t>();
    f.height = options.at("height").get<uint64_t>();
    f.samples = options.at("samples_per_pixel").get<uint64_t>();
    f.triangles_count = json.at("scene").at("triangles_count").get<uint64_t>();
    f.order = options.at("order").get<std::string>();
    for (const Json& effect : json.at("effects")) {
      if (effect.at("on").get<bool>()) f.effects.push_back(effect.at("name").get<std::string>());
    }
    return f;
  } catch (const Json::exception& error) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected the statistics of a render, found: {}", stats_path,
                                                escape_name(error.what()))};
  }
}

}  // namespace shoal
