#include "engine/accuracy_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "engine/process_memory.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

struct Column {
  const char* name;
  const char* sentence;
  Json (*value)(const AccuracyRow& row);
};

Json optional_json(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

const Column kColumns[] = {
    {"name", "the row", [](const AccuracyRow& r) -> Json { return r.name; }},
    {"knob", "what is turned: base, a knob, or together", [](const AccuracyRow& r) -> Json { return r.knob; }},
    {"value", "to what", [](const AccuracyRow& r) -> Json { return r.value; }},
    {"samples_per_pixel", "paths a pixel", [](const AccuracyRow& r) -> Json { return r.samples; }},
    {"base", "nothing is turned", [](const AccuracyRow& r) -> Json { return r.base; }},
    {"pareto", "no other row has less of both render_seconds and rel_mse",
     [](const AccuracyRow& r) -> Json { return r.pareto; }},
    {"render_seconds", "of a render, median over the seeds, over machine_pace",
     [](const AccuracyRow& r) -> Json { return r.seconds; }},
    {"render_seconds_min", "the fastest", [](const AccuracyRow& r) -> Json { return r.seconds_min; }},
    {"render_seconds_max", "the slowest", [](const AccuracyRow& r) -> Json { return r.seconds_max; }},
    {"machine_pace", "seconds of the base beside this row, over those of the base's own row",
     [](const AccuracyRow& r) -> Json { return r.machine_pace; }},
    {"build_seconds", "of the .shoal; null: it was there already",
     [](const AccuracyRow& r) { return optional_json(r.build_seconds); }},
    {"disk_read_bytes", "asked of the disk by the render of median time",
     [](const AccuracyRow& r) -> Json { return r.disk_read_bytes; }},
    {"file_bytes", "of the .shoal", [](const AccuracyRow& r) -> Json { return r.file_bytes; }},
    {"file_bytes_per_triangle", "file_bytes over the scene's triangles",
     [](const AccuracyRow& r) -> Json { return r.bytes_a_triangle; }},
    {"rel_mse", "relative squared error without the worst 0.1 % of the pixels, mean over the seeds",
     [](const AccuracyRow& r) -> Json { return r.rel_mse; }},
    {"rel_mse_min", "the least of a seed", [](const AccuracyRow& r) -> Json { return r.rel_mse_min; }},
    {"rel_mse_max", "the most of a seed", [](const AccuracyRow& r) -> Json { return r.rel_mse_max; }},
    {"rel_mse_untrimmed", "with the worst pixels", [](const AccuracyRow& r) -> Json { return r.rel_mse_all; }},
    {"flip", "mean LDR-FLIP, 0 to 1, mean over the seeds", [](const AccuracyRow& r) -> Json { return r.flip; }},
    {"variance", "relative, between seeds", [](const AccuracyRow& r) -> Json { return r.error.variance.value; }},
    {"variance_low", "lower end of its 95 % interval",
     [](const AccuracyRow& r) -> Json { return r.error.variance.low; }},
    {"variance_high", "upper end", [](const AccuracyRow& r) -> Json { return r.error.variance.high; }},
    {"bias_squared", "relative, what no number of samples takes away; around 0 where there is none",
     [](const AccuracyRow& r) -> Json { return r.error.bias_squared.value; }},
    {"bias_squared_low", "lower end of its 95 % interval",
     [](const AccuracyRow& r) -> Json { return r.error.bias_squared.low; }},
    {"bias_squared_high", "upper end", [](const AccuracyRow& r) -> Json { return r.error.bias_squared.high; }},
    {"biased", "bias_squared is above 0 beyond doubt (99 %)",
     [](const AccuracyRow& r) -> Json { return r.error.biased; }},
    {"efficiency", "1 / (variance x render_seconds)", [](const AccuracyRow& r) -> Json { return r.efficiency.value; }},
    {"efficiency_low", "lower end of its 95 % interval, by the variance alone",
     [](const AccuracyRow& r) -> Json { return r.efficiency.low; }},
    {"efficiency_high", "upper end", [](const AccuracyRow& r) -> Json { return r.efficiency.high; }},
    {"order", "of traversal", [](const AccuracyRow& r) -> Json { return r.order; }},
};

Json knobs_json(const AccuracyResult& result) {
  Json knobs = Json::array();
  for (size_t i = 0; i < result.knobs.size(); ++i) {
    const AccuracyKnob& knob = result.knobs[i];
    Json values = Json::array();
    for (const KnobValue& value : knob.values) values.push_back(value.name);
    knobs.push_back({{"name", knob.name},
                     {"option", knob.option},
                     {"sentence", knob.sentence},
                     {"biases", knob.biases},
                     {"rebuilds", knob.rebuilds},
                     {"values", values},
                     {"base", result.base().settings[i]}});
  }
  return knobs;
}

Json row_json(const AccuracyResult& result, const AccuracyRow& row) {
  Json json;
  for (const Column& column : kColumns) json[column.name] = column.value(row);
  for (size_t i = 0; i < result.knobs.size(); ++i) json["settings"][result.knobs[i].name] = row.settings[i];
  return json;
}

/// RFC 4180.
std::string csv_field(const Json& value) {
  const std::string text = value.is_null() ? "" : value.is_string() ? value.get<std::string>() : value.dump();
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted(1, '"');
  for (const char c : text) quoted.append(c == '"' ? 2 : 1, c);
  quoted += '"';
  return quoted;
}

}  // namespace

std::vector<AccuracyColumn> accuracy_columns() {
  std::vector<AccuracyColumn> columns;
  for (const Column& column : kColumns) columns.push_back({column.name, column.sentence});
  return columns;
}

std::string accuracy_json(const AccuracyResult& result, const Scene& scene, const AccuracyJob& job) {
  Json json;
  json["schema_version"] = 1;
  json["program"] = "Shoal " SHOAL_VERSION;
  json["machine"] = Json::parse(machine_description());
  json["scene"] = {{"file", scene.file->path()},
                   {"file_bytes", scene.file->file_bytes()},
                   {"triangles_count", scene.header.triangles_count}};
  json["picture"] = {{"width", result.sizes.width},
                     {"height", result.sizes.height},
                     {"samples_per_pixel", result.sizes.samples},
                     {"camera", job.base.picture.camera},
                     {"seed", job.base.picture.shading.seed},
                     {"exposure_stops", result.exposure},
                     {"tonemap", job.curve == ToneCurve::kPbrNeutral ? "pbr-neutral" : "none"}};
  json["asked"] = {{"width", result.asked.width},
                   {"height", result.asked.height},
                   {"samples_per_pixel", result.asked.samples},
                   {"reference_samples_per_pixel", result.asked.reference_samples}};
  json["seeds_count"] = result.seeds;
  json["budget_seconds"] = result.budget_seconds;
  json["total_seconds"] = result.total_seconds;
  json["max_memory_bytes"] = job.execution.max_memory_bytes;
  json["peak_rss_bytes"] = peak_resident_set_bytes();
  json["threads_count"] = job.execution.threads;
  json["reference"] = {{"given", result.reference_given},
                       {"samples_per_pixel", result.reference_given ? Json(nullptr) : Json(result.sizes.reference_samples)},
                       {"render_seconds", result.reference_seconds},
                       {"noise_known", result.reference_noise_known},
                       {"noise", result.reference_noise_known ? Json(result.reference_noise) : Json(nullptr)}};
  json["knobs"] = knobs_json(result);
  Json& columns = json["columns"] = Json::array();
  for (const Column& column : kColumns) columns.push_back({{"name", column.name}, {"meaning", column.sentence}});
  Json& rows = json["rows"] = Json::array();
  for (const AccuracyRow& row : result.rows) rows.push_back(row_json(result, row));
  Json& sentences = json["sentences"] = Json::array();
  for (const AccuracySentence& sentence : accuracy_sentences(result)) {
    sentences.push_back({{"knob", sentence.knob}, {"text", sentence.text}});
  }
  json["left_out"] = result.left_out;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string accuracy_csv(const AccuracyResult& result) {
  std::vector<std::string> head;
  for (const Column& column : kColumns) head.emplace_back(column.name);
  for (const AccuracyKnob& knob : result.knobs) head.push_back(csv_field("knob:" + knob.name));
  std::string text = fmt::format("{}\r\n", fmt::join(head, ","));
  for (const AccuracyRow& row : result.rows) {
    std::vector<std::string> fields;
    for (const Column& column : kColumns) fields.push_back(csv_field(column.value(row)));
    for (const std::string& value : row.settings) fields.push_back(csv_field(value));
    text += fmt::format("{}\r\n", fmt::join(fields, ","));
  }
  return text;
}

}  // namespace shoal
