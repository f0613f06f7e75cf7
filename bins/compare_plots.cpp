// The sections of the page of `shoal compare` that have plots: traffic, what happens over time, phases, treelets.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "bins/compare_page.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

/// Of a JSON pointer.
std::string escaped(const std::string& key) {
  std::string text;
  for (const char c : key) text += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return text;
}

std::vector<std::string> labels_of(const Json& json) {
  std::vector<std::string> labels;
  for (const auto& [label, order] : json["orders"].items()) labels.push_back(label);
  return labels;
}

/// A line an order: a column of its timeline.
ReportPlot line_plot(const Json& json, const std::string& title, const std::string& label, const char* column,
                     bool bytes, const std::function<bool(const Json&)>& shown) {
  ReportPlot plot{title, "seconds", label, false, false, {}};
  plot.y_bytes = bytes;
  plot.half = true;
  for (const auto& [order_label, order] : json["orders"].items()) {
    if (!order.contains("timeline") || !order["timeline"].contains(column) || !shown(order["timeline"])) continue;
    ReportSeries series{order_label, order["timeline"]["seconds"], order["timeline"][column], {}, true, false};
    series.dots = false;
    plot.series.push_back(std::move(series));
  }
  return plot;
}

/// The levels of all orders, in the order in which they come up.
std::vector<std::string> levels_of(const Json& json) {
  std::vector<std::string> levels;
  for (const auto& [label, order] : json["orders"].items()) {
    const Json traffic = order.value("traffic", Json::object());
    for (const auto& [level, figures] : traffic.items()) {
      if (std::find(levels.begin(), levels.end(), level) == levels.end()) levels.push_back(level);
    }
  }
  return levels;
}

uint64_t most_of(const Json& json, const char* column) {
  uint64_t most = 0;
  for (const auto& [label, order] : json["orders"].items()) {
    if (!order.contains("treelet_heat")) continue;
    for (const Json& value : order["treelet_heat"][column]) most = std::max(most, value.get<uint64_t>());
  }
  return most;
}

/// Whether the order only counts the crossings of all treelets together.
bool is_untold(const Json& order, const std::string& column) {
  const Json& cells = order["treelet_heat"][column];
  return column == "visits_count" && order["counters"]["totals"].value("treelet_visits_count", uint64_t{0}) > 0 &&
         std::all_of(cells.begin(), cells.end(), [](const Json& cell) { return cell == 0; });
}

}  // namespace

ReportSection traffic_section(const std::string& text) {
  const Json json = Json::parse(text);
  ReportSection section{"Bytes a ray, by level", {}};
  const std::vector<std::string> levels = levels_of(json), labels = labels_of(json);
  if (levels.empty()) return section;
  ReportPlot plot{"What moves for a ray", "", "bytes a ray", false, true, {}};
  plot.groups = levels;
  ReportTable table{{"level"}, {}, ""};
  for (const std::string& label : labels) {
    table.head.push_back(label);
    ReportSeries series{label, {}, {}, {}, false, false};
    const Json& traffic = json["orders"][label]["traffic"];
    for (size_t i = 0; i < levels.size(); ++i) {
      if (!traffic.contains(levels[i])) continue;
      series.x.push_back(static_cast<double>(i));
      series.y.push_back(traffic[levels[i]]["bytes_per_ray"]);
    }
    plot.series.push_back(std::move(series));
  }
  table.head.emplace_back("is");
  for (const std::string& level : levels) {
    ReportTable::Row row{{{level}}};
    std::string meaning;
    for (const std::string& label : labels) {
      const Json& traffic = json["orders"][label]["traffic"];
      if (!traffic.contains(level)) {
        row.cells.push_back({"-"});
        continue;
      }
      const double value = traffic[level]["bytes_per_ray"];
      meaning = traffic[level].value("meaning", "");
      row.cells.push_back({value < 1000 ? fmt::format("{:.4g}", value) : fmt::format("{:.0f}", value), value,
                           fmt::format("/orders/{}/traffic/{}/bytes_per_ray", escaped(label), escaped(level))});
    }
    row.cells.push_back({meaning});
    table.rows.push_back(std::move(row));
  }
  section.blocks.emplace_back(std::move(plot));
  section.blocks.emplace_back(ReportText{"The axis is logarithmic; a level without a bar moved nothing."});
  section.blocks.emplace_back(std::move(table));
  return section;
}

ReportSection time_section(const std::string& text) {
  const Json json = Json::parse(text);
  ReportSection section{"Over time", {}};
  const auto always = [](const Json&) { return true; };
  const auto queues = [](const Json& timeline) { return timeline.value("has_queues", false); };
  const auto add = [&](ReportPlot plot) {
    if (!plot.series.empty()) section.blocks.emplace_back(std::move(plot));
  };
  add(line_plot(json, "Traffic: read from disk", "bytes", "disk_read_bytes", true, always));
  add(line_plot(json, "Traffic: how fast", "bytes a second", "disk_read_bytes_per_second", true, always));
  add(line_plot(json, "Queues: rays and paths that wait", "rays", "rays_waiting_count", false, queues));
  add(line_plot(json, "Queues: treelets that have any waiting", "treelets", "treelets_waiting_count", false,
                queues));
  add(line_plot(json, "Paths in flight", "paths", "paths_in_flight_count", false, always));
  add(line_plot(json, "The page cache", "bytes", "cache_bytes", true, always));
  add(line_plot(json, "Samples done", "samples", "samples_done_count", false, always));
  if (!section.blocks.empty()) {
    section.blocks.emplace_back(
        ReportText{"Of the first run of each order, looked at from a thread of its own; timeline.csv has every "
                   "sample. Orders that keep no "
                   "queues have no line among queues."});
  }
  return section;
}

ReportSection phase_section(const std::string& text) {
  const Json json = Json::parse(text);
  ReportSection section{"Time by phase", {}};
  const std::vector<std::string> labels = labels_of(json);
  ReportPlot plot{"Where the time of all threads goes", "", "thread seconds", false, false, {}};
  plot.groups = labels;
  plot.stacked = true;
  ReportTable table{{"phase"}, {}, "Every thread is in one phase at a time: they sum to wall time x threads."};
  std::vector<std::string> phases;
  for (const auto& [label, order] : json["orders"].items()) {
    for (const auto& [phase, seconds] : order["phases"]["seconds"].items()) {
      if (std::find(phases.begin(), phases.end(), phase) == phases.end()) phases.push_back(phase);
    }
    table.head.push_back(label);
    table.head.push_back("share");
  }
  table.head.emplace_back("is");
  for (const std::string& phase : phases) {
    ReportSeries series{phase, {}, {}, {}, false, false};
    ReportTable::Row row{{{phase}}};
    std::string meaning;
    for (size_t i = 0; i < labels.size(); ++i) {
      const Json& times = json["orders"][labels[i]]["phases"];
      if (!times["seconds"].contains(phase)) {
        row.cells.insert(row.cells.end(), 2, {"-"});
        continue;
      }
      const double seconds = times["seconds"][phase], share = times["shares"][phase];
      meaning = times["meanings"].value(phase, "");
      series.x.push_back(static_cast<double>(i)), series.y.push_back(seconds);
      const std::string place = fmt::format("/orders/{}/phases/", escaped(labels[i]));
      row.cells.push_back({fmt::format("{:.3f} s", seconds), seconds, place + "seconds/" + escaped(phase)});
      row.cells.push_back({fmt::format("{:.1f} %", 100 * share), share, place + "shares/" + escaped(phase)});
    }
    row.cells.push_back({meaning});
    table.rows.push_back(std::move(row));
    plot.series.push_back(std::move(series));
  }
  section.blocks.emplace_back(std::move(plot));
  section.blocks.emplace_back(std::move(table));
  return section;
}

ReportSection heat_section(const std::string& text) {
  const Json json = Json::parse(text);
  ReportSection section{"Treelets", {}};
  struct Measure {
    const char *column, *title, *unit;
  };
  for (const Measure& measure :
       {Measure{"loads_count", "read from disk", "reads"}, Measure{"visits_count", "crossed by rays", "visits"}}) {
    ReportHeatMaps block;
    std::vector<std::string> untold;
    const uint64_t end = most_of(json, measure.column);
    for (const auto& [label, order] : json["orders"].items()) {
      if (!order.contains("treelet_heat")) continue;
      const Json& heat = order["treelet_heat"];
      if (is_untold(order, measure.column)) {
        untold.push_back(label);
        continue;
      }
      block.maps.push_back({label + ": " + measure.title, measure.unit, heat["treelets_count"],
                            heat["treelets_a_cell"], heat[measure.column], end});
    }
    const std::string note =
        untold.empty()
            ? ""
            : fmt::format("Not counted by treelet in {}, which trace a ray from its start to its end in one go.",
                          fmt::join(untold, ", "));
    if (block.maps.empty()) {
      if (!note.empty()) section.blocks.emplace_back(ReportText{note});
      continue;
    }
    block.caption = fmt::format(
        "How often treelets were {}. Each square is {}, row by row as they lie in the file, where "
        "neighbours in the scene lie close; logarithmic, one scale for all orders. A square in the colour "
        "of table heads: never.",
        measure.title,
        block.maps[0].items_a_cell == 1 ? std::string("a treelet")
                                        : fmt::format("{} treelets", block.maps[0].items_a_cell));
    if (!note.empty()) block.caption += " " + note;
    section.blocks.emplace_back(std::move(block));
  }
  return section;
}

}  // namespace shoal
