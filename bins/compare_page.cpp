#include "bins/compare_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/render_report.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

enum class Shown { kCount, kBytes, kSeconds, kShare, kNumber };

/// A row of the table of all orders.
struct Figure {
  const char *title, *place;
  Shown shown;
};
constexpr Figure kFigures[] = {
    {"seconds", "/render_seconds", Shown::kSeconds},
    {"million rays a second", "/derived/million_rays_per_second", Shown::kNumber},
    {"rays", "/counters/totals/rays_traced_count", Shown::kCount},
    {"read from disk", "/counters/totals/disk_read_bytes", Shown::kBytes},
    {"disk reads", "/counters/totals/disk_reads_count", Shown::kCount},
    {"treelet loads from disk", "/counters/totals/treelet_loads_count", Shown::kCount},
    {"bytes from disk a ray", "/traffic/disk/bytes_per_ray", Shown::kNumber},
    {"page requests", "/counters/totals/page_requests_count", Shown::kCount},
    {"page hits", "/derived/page_hit_share", Shown::kShare},
    {"treelets taken in hand", "/counters/totals/treelet_batches_count", Shown::kCount},
    {"treelet bytes taken in hand", "/counters/totals/treelet_visit_bytes", Shown::kBytes},
    {"ray visits a treelet in hand", "/derived/visits_per_treelet_in_hand", Shown::kNumber},
    {"treelet visits a ray", "/derived/visits_per_ray", Shown::kNumber},
    {"ray bytes through queues", "/counters/totals/ray_moved_bytes", Shown::kBytes},
    {"path state bytes touched", "/counters/totals/path_state_moved_bytes", Shown::kBytes},
    {"page cache", "/memory/cache_bytes", Shown::kBytes},
    {"most of it used", "/memory/peak_cache_bytes", Shown::kBytes},
    {"paths in flight at most", "/memory/paths_in_flight_count", Shown::kCount},
};

/// Of a JSON pointer.
std::string escaped(const std::string& key) {
  std::string text;
  for (const char c : key) text += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return text;
}

std::string number_text(double value, Shown shown) {
  switch (shown) {
    case Shown::kCount: return fmt::format("{:.0f}", value);
    case Shown::kBytes: return format_bytes(static_cast<uint64_t>(value));
    case Shown::kSeconds: return fmt::format("{:.2f} s", value);
    case Shown::kShare: return fmt::format("{:.2f} %", 100 * value);
    case Shown::kNumber: return value < 1000 ? fmt::format("{:.4g}", value) : fmt::format("{:.0f}", value);
  }
  return "";
}

/// By what the name of a figure ends with.
Shown shown_for(const std::string& name) {
  if (name.ends_with("_bytes")) return Shown::kBytes;
  if (name.ends_with("_count") || name == "ways" || name == "bounce") return Shown::kCount;
  if (name.ends_with("_seconds")) return Shown::kSeconds;
  return Shown::kNumber;
}

ReportCell cell_at(const Json& json, const std::string& place, Shown shown) {
  const Json::json_pointer pointer(place);
  if (!json.contains(pointer)) return {"-"};
  const Json& value = json.at(pointer);
  if (value.is_boolean()) return {value.get<bool>() ? "yes" : "no"};
  if (value.is_string()) return {value.get<std::string>()};
  if (!value.is_number()) return {"-"};
  return {number_text(value, shown), value.get<double>(), place};
}

std::string order_place(const std::string& label) { return fmt::format("/orders/{}", escaped(label)); }

ReportSection summary_section(const Json& json) {
  ReportSection section{"In short", {}};
  const bool identical = json.value("pictures_identical", false);
  const size_t count = json["orders"].size();
  std::string sentence = identical ? fmt::format("{} orders, one picture: every bit of it is the same.", count)
                                   : fmt::format("The pictures of {} orders DIFFER: this is a bug.", count);
  if (count == 1) sentence = "One order.";
  section.blocks.emplace_back(ReportText{sentence});
  ReportList list;
  const Json* first = nullptr;
  std::string first_label;
  for (const auto& [label, order] : json["orders"].items()) {
    const double seconds = order["render_seconds"], bytes = order["counters"]["totals"]["disk_read_bytes"];
    std::string text = fmt::format("{}: {:.2f} s, {} from disk", label, seconds, format_bytes(static_cast<uint64_t>(bytes)));
    if (first == nullptr) {
      first = &order, first_label = label;
    } else {
      const double first_seconds = (*first)["render_seconds"], first_bytes = (*first)["counters"]["totals"]["disk_read_bytes"];
      text += fmt::format("; {:.2f} times the time", first_seconds > 0 ? seconds / first_seconds : 0);
      if (first_bytes > 0) text += fmt::format(" and {:.2f} times the bytes", bytes / first_bytes);
      text += " of " + first_label;
    }
    list.items.push_back(text + ".");
  }
  section.blocks.emplace_back(std::move(list));
  ReportTable table{{""}, {}, "Of several runs the one of median time. Every number is in compare.json and compare.csv."};
  for (const auto& [label, order] : json["orders"].items()) table.head.push_back(label);
  for (const Figure& figure : kFigures) {
    ReportTable::Row row{{{figure.title}}};
    for (const auto& [label, order] : json["orders"].items()) {
      row.cells.push_back(cell_at(json, order_place(label) + figure.place, figure.shown));
    }
    table.rows.push_back(std::move(row));
  }
  section.blocks.emplace_back(std::move(table));
  return section;
}

/// Columns for all keys of plain values in the objects at `places`, a row each, behind the cells that it has.
struct PlainTable {
  const Json& json;
  ReportTable table;
  size_t cells_before = table.head.size();
  std::vector<std::string> columns = {};

  void add(ReportTable::Row row, const std::string& place, const std::vector<std::string>& without) {
    for (const auto& [key, value] : json.at(Json::json_pointer(place)).items()) {
      const bool shown = !value.is_structured() && std::find(without.begin(), without.end(), key) == without.end();
      if (!shown || std::find(columns.begin(), columns.end(), key) != columns.end()) continue;
      columns.push_back(key);
      table.head.push_back(key);
    }
    for (const std::string& column : columns) {
      row.cells.push_back(cell_at(json, fmt::format("{}/{}", place, escaped(column)), shown_for(column)));
    }
    table.rows.push_back(std::move(row));
  }
  /// Rows that came before a column have nothing there.
  ReportTable finished() {
    for (ReportTable::Row& row : table.rows) row.cells.resize(cells_before + columns.size(), {"-"});
    return std::move(table);
  }
};

/// What a model of the processor's caches says, and its own counters, where there are any.
ReportSection caches_section(const Json& json) {
  ReportSection section{"The processor's caches", {}};
  PlainTable model{json, {{"order", "level"}, {}, "By a model that is told every access; docs/measuring.md."}};
  PlainTable hardware{json, {{"order"}, {}, "The processor's own counters, of the whole run."}};
  for (const auto& [label, order] : json["orders"].items()) {
    const Json levels = order.value(Json::json_pointer("/cache_model/levels"), Json::array());
    for (size_t i = 0; i < levels.size(); ++i) {
      model.add({{{label}, {levels[i].value("name", "")}}}, fmt::format("{}/cache_model/levels/{}", order_place(label), i),
                {"name"});
    }
    if (!order.value(Json::json_pointer("/hardware_counters/available"), false)) continue;
    hardware.add({{{label}}}, fmt::format("{}/hardware_counters", order_place(label)), {"available", "reason"});
  }
  for (PlainTable* table : {&model, &hardware}) {
    if (!table->table.rows.empty()) section.blocks.emplace_back(table->finished());
  }
  return section;
}

/// How fast each order traces rays of each kind, where that was measured.
ReportSection kinds_section(const Json& json) {
  ReportSection section{"Kinds of rays", {}};
  PlainTable table{json, {{"kind", "bounce", "rays", "order"}, {}, "The same rays of each kind, in each order."}};
  const Json kinds = json.value("ray_kinds", Json::array());
  for (size_t i = 0; i < kinds.size(); ++i) {
    const std::string place = fmt::format("/ray_kinds/{}", i);
    const Json orders = kinds[i].value("orders", Json::object());
    for (const auto& [label, figures] : orders.items()) {
      table.add({{cell_at(json, place + "/kind", Shown::kCount), cell_at(json, place + "/bounce", Shown::kCount),
                  cell_at(json, place + "/rays_count", Shown::kCount), {label}}},
                fmt::format("{}/orders/{}", place, escaped(label)), {});
    }
  }
  if (!table.table.rows.empty()) section.blocks.emplace_back(table.finished());
  return section;
}

ReportSection pictures_section(const Json& json, const std::vector<ComparedPicture>& pictures) {
  ReportSection section{"The pictures", {}};
  if (pictures.empty()) return section;
  const bool identical = json.value("pictures_identical", false);
  section.blocks.emplace_back(ReportText{
      identical ? "Identical: the difference of each picture from the first is 0 in every channel of every pixel, which is black."
                : "Not identical: beside each picture is its difference from the first, the largest one white."});
  ReportPictures block;
  for (const ComparedPicture& picture : pictures) {
    block.width = picture.picture.width, block.height = picture.picture.height;
    ReportPictures::Item item{picture.label, {picture.picture.rgb}};
    if (&picture != &pictures.front()) {
      item.rgb.push_back(picture.difference.rgb);
      item.caption += picture.pixels_differing == 0
                          ? fmt::format("; beside it its difference from {}: identical", pictures.front().label)
                          : fmt::format("; beside it its difference from {}: {} pixels, at most {:.3g}", pictures.front().label,
                                        picture.pixels_differing, picture.max_difference);
    }
    block.items.push_back(std::move(item));
  }
  section.blocks.emplace_back(std::move(block));
  return section;
}

ReportSection effects_section(const Json& json) {
  ReportSection section{"The effects plan", {}};
  if (json["orders"].empty()) return section;
  const Json effects = json["orders"].front().value("effects", Json::array());
  ReportTable table{{"effect", "of", "state", "called for by", "callers", "first of them"},
                    {},
                    "What nothing calls for is not evaluated and has no table. Forced: by --effects."};
  for (const Json& effect : effects) {
    const bool on = effect.value("on", false);
    std::string state = on ? "on" : "off";
    if (effect.value("forced", false)) state += ", forced";
    const auto callers = effect.value("callers_count", uint64_t{0});
    table.rows.push_back({{{effect.value("name", "")}, {effect.value("extension", "")}, {state},
                           {effect.value("called_for_by", "")}, {fmt::format("{}", callers)},
                           {effect.value("first_caller", "")}},
                          on});
  }
  if (!table.rows.empty()) section.blocks.emplace_back(std::move(table));
  return section;
}

void add_rows(const Json& json, const std::string& place, const std::string& prefix, ReportTable& table) {
  const Json::json_pointer pointer(place);
  if (!json.contains(pointer)) return;
  for (const auto& [key, value] : json.at(pointer).items()) {
    if (value.is_structured()) continue;
    table.rows.push_back({{{prefix + key}, cell_at(json, place + "/" + escaped(key), shown_for(key))}});
  }
}

ReportSection machine_section(const Json& json) {
  ReportSection section{"Machine, scene and command", {}};
  section.blocks.emplace_back(ReportText{json.value("command_line", "")});
  ReportTable table{{"", ""}, {}, "Options as they were resolved for the first order; all of them are in compare.json."};
  for (const char* key : {"program", "date"}) table.rows.push_back({{{key}, {json.value(key, "")}}});
  add_rows(json, "/machine", "", table);
  if (!json["orders"].empty()) {
    const std::string first = order_place(json["orders"].begin().key());
    table.rows.push_back({{{"threads_count"}, cell_at(json, first + "/threads_count", Shown::kCount)}});
    table.rows.push_back({{{"memory cap"}, cell_at(json, first + "/memory/cap_bytes", Shown::kBytes)}});
    add_rows(json, first + "/scene", "scene: ", table);
    add_rows(json, first + "/options", "option: ", table);
  }
  section.blocks.emplace_back(std::move(table));
  return section;
}

}  // namespace

ReportPage compare_page(const std::string& text, const std::vector<ComparedPicture>& pictures) {
  const Json json = Json::parse(text);
  std::string scene = json.value("scene_asked", "");  // not its .shoal, whose name may be a hash
  scene = scene.substr(scene.rfind('/') + 1);
  ReportPage page{"Orders compared: " + scene, json.value("program", "") + ", shoal compare, " + json.value("date", ""), {}, text};
  const auto add = [&](ReportSection section) {
    if (!section.blocks.empty()) page.sections.push_back(std::move(section));
  };
  add(summary_section(json));
  add(traffic_section(text));
  add(caches_section(json));
  add(time_section(text));
  add(phase_section(text));
  add(heat_section(text));
  add(kinds_section(json));
  add(pictures_section(json, pictures));
  add(effects_section(json));
  add(machine_section(json));
  return page;
}

}  // namespace shoal
