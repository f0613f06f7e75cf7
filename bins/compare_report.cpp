#include "bins/compare_report.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "bins/compare_page.h"
#include "engine/batch_text.h"
#include "engine/record_report.h"
#include "engine/render_report.h"
#include "treelets/instruction_set.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

/// Where bytes move, from far to near, and the counter that says how many.
struct Level {
  const char *name, *counter, *meaning;
};
constexpr Level kLevels[] = {
    {"disk", "disk_read_bytes", "asked of the disk: whole blocks of stored pages"},
    {"decoded pages", "decoded_bytes", "pages after decompression, into the page cache"},
    {"treelets in hand", "treelet_visit_bytes",
     "sizes of the treelets taken in hand: what moves from memory to the processor at most"},
    {"rays in queues", "ray_moved_bytes", "rays written to and read from queues"},
    {"path states", "path_state_moved_bytes", "path states touched, at birth, after each ray, at shading and at the end"},
};
constexpr double kLineBytes = 64;

double ratio(double a, double b) { return b == 0 ? 0 : a / b; }

/// {name: {bytes, bytes_per_ray, meaning}}; with a model of the processor's caches, the lines into each of them as well.
Json traffic_of(const Json& order) {
  const Json& totals = order["counters"]["totals"];
  const double rays = totals.value("rays_traced_count", 0.0);
  Json traffic = Json::object();
  for (const Level& level : kLevels) {
    if (!totals.contains(level.counter)) continue;
    const Json& bytes = totals[level.counter];
    traffic[level.name] = {{"bytes", bytes}, {"bytes_per_ray", ratio(bytes, rays)}, {"meaning", level.meaning}};
  }
  if (!order.contains("cache_model")) return traffic;
  const Json& model = order["cache_model"];
  const double line_bytes = model.value("line_bytes", kLineBytes);
  for (const Json& level : model.value("levels", Json::array())) {
    if (!level.contains("name") || !level.contains("misses_count")) continue;
    const double bytes = line_bytes * level["misses_count"].get<double>();
    traffic[fmt::format("lines into {}", level["name"].get<std::string>())] = {
        {"bytes", bytes}, {"bytes_per_ray", ratio(bytes, rays)}, {"meaning", "cache lines, by the model of the caches"}};
  }
  if (model.contains("memory_bytes_per_ray")) {
    traffic["memory"] = {{"bytes_per_ray", model["memory_bytes_per_ray"]},
                         {"meaning", "lines from memory, by the model of the caches"}};
  }
  return traffic;
}

/// What the reader of a figure asks first.
Json derived_of(const Json& order) {
  const Json& totals = order["counters"]["totals"];
  const auto of = [&](const char* name) { return totals.value(name, 0.0); };
  return {{"million_rays_per_second", order.value("rays_per_second", 0.0) * 1e-6},
          {"page_hit_share", ratio(of("page_hits_count"), of("page_requests_count"))},
          {"visits_per_treelet_in_hand", ratio(of("treelet_visits_count"), of("treelet_batches_count"))},
          {"visits_per_ray", ratio(of("treelet_visits_count"), of("rays_traced_count"))}};
}

Json pictures_json(const CompareReport& report) {
  Json json = Json::object();
  for (const ComparedPicture& picture : report.pictures) {
    json[picture.label] = {{"identical", picture.pixels_differing == 0},
                           {"pixels_differing_count", picture.pixels_differing},
                           {"max_difference", picture.max_difference}};
  }
  return json;
}

Json document(const CompareReport& report) {
  Json json = Json::parse(report.json);
  json["program"] = "Shoal " SHOAL_VERSION;
  json["date"] = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  json["command_line"] = shell_line(report.command_line);
  json["machine"] = Json::parse(machine_description());
  json["machine"]["instruction_set"] = instruction_set();
  json["pictures"] = pictures_json(report);
  for (auto& [label, order] : json["orders"].items()) {
    order["derived"] = derived_of(order);
    order["traffic"] = traffic_of(order);
  }
  for (const auto& [label, course] : report.courses) {
    json["orders"][label]["timeline"] = Json::parse(timeline_json(course));
    json["orders"][label]["treelet_heat"] = Json::parse(heat_json(course));
  }
  return json;
}

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

bool is_flat(const Json& json) {
  return json.is_array() && std::all_of(json.begin(), json.end(), [](const Json& item) { return !item.is_structured(); });
}

/// Indented, but lists of plain values on one line: there are thousands of them.
void write_json(const Json& json, size_t depth, std::string& out) {
  if (!json.is_structured() || json.empty() || is_flat(json)) {
    out += dump(json);
    return;
  }
  out += json.is_object() ? "{" : "[";
  bool first = true;
  for (const auto& [key, value] : json.items()) {
    out += first ? "\n" : ",\n";
    out.append(depth + 1, ' ');
    first = false;
    if (json.is_object()) out += dump(Json(key)) + ": ";
    write_json(value, depth + 1, out);
  }
  out += "\n";
  out.append(depth, ' ');
  out += json.is_object() ? "}" : "]";
}

std::string csv_word(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string csv_value(const Json& value) { return csv_word(value.is_string() ? value.get<std::string>() : dump(value)); }

/// A row a plain value: order, its place in the document with dots, the value.
void add_figures(const std::string& order, const std::string& place, const Json& json, std::string& csv) {
  for (const auto& [key, value] : json.items()) {
    if (key == "timeline" || key == "treelet_heat" || key == "counter_list" || key == "meanings" || key == "meaning") continue;
    const std::string name = place.empty() ? key : fmt::format("{}.{}", place, key);
    if (value.is_structured()) {
      add_figures(order, name, value, csv);
    } else {
      csv += fmt::format("{},{},{}\n", csv_word(order), csv_word(name), csv_value(value));
    }
  }
}

std::string figures_csv(const Json& json) {
  std::string csv = "order,figure,value\n";
  Json general = json;
  general.erase("orders");
  add_figures("", "", general, csv);
  for (const auto& [label, order] : json["orders"].items()) add_figures(label, "", order, csv);
  return csv;
}

/// Lists under `block` of every order as columns; `first(i)` comes before them in row i.
template <class First>
std::string columns_csv(const Json& json, const char* block, const std::string& head, const First& first) {
  std::string csv;
  for (const auto& [label, order] : json["orders"].items()) {
    if (!order.contains(block)) continue;
    const Json& table = order[block];
    if (csv.empty()) {
      csv = head;
      for (const Json& column : table["columns"]) csv += fmt::format(",{}", column["name"].get<std::string>());
      csv += "\n";
    }
    const size_t rows = table[table["columns"][0]["name"].get<std::string>()].size();
    for (size_t i = 0; i < rows; ++i) {
      csv += csv_word(label) + first(table, i);
      for (const Json& column : table["columns"]) csv += fmt::format(",{}", dump(table[column["name"].get<std::string>()][i]));
      csv += "\n";
    }
  }
  return csv;
}

Status write_text(FileSystem& fs, const std::string& path, const std::string& text) {
  return write_whole_file(fs, path, std::as_bytes(std::span(text)));
}

}  // namespace

std::vector<std::string> own_command_line() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::vector<std::string> words;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\0', at), text.size());
    words.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  if (!words.empty()) words[0] = words[0].substr(words[0].rfind('/') + 1);
  return words;
}

Status write_compare_report(FileSystem& fs, const std::string& folder, const CompareReport& report) {
  const Json json = document(report);
  std::string text;
  write_json(json, 0, text);
  text += "\n";
  SHOAL_RETURN_IF_ERROR(write_text(fs, folder + "/compare.json", text));
  SHOAL_RETURN_IF_ERROR(write_text(fs, folder + "/compare.csv", figures_csv(json)));
  const auto nothing = [](const Json&, size_t) { return std::string(); };
  SHOAL_RETURN_IF_ERROR(write_text(fs, folder + "/timeline.csv", columns_csv(json, "timeline", "order", nothing)));
  const auto treelets = [](const Json& table, size_t i) {
    return fmt::format(",{}", i * table["treelets_a_cell"].get<size_t>());
  };
  SHOAL_RETURN_IF_ERROR(
      write_text(fs, folder + "/treelets.csv", columns_csv(json, "treelet_heat", "order,first_treelet", treelets)));
  SHOAL_ASSIGN_OR_RETURN(const std::string html, report_html(compare_page(text, report.pictures)));
  return write_text(fs, folder + "/report.html", html);
}

}  // namespace shoal
