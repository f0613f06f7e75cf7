#include "engine/level_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

double per(uint64_t count, uint64_t rays) {
  return rays == 0 ? 0.0 : static_cast<double>(count) / static_cast<double>(rays);
}

// X(member of LaneUses, name, words)
#define SHOAL_LANE_USES(X)                    \
  X(top_nodes, "top_nodes", "top tree nodes") \
  X(nodes, "treelet_nodes", "treelet nodes")  \
  X(leaves, "treelet_leaves", "leaves")       \
  X(packets, "packets", "rays of packets")

Json level_json(const CacheShape& shape, const LevelCounts& counts, size_t index, size_t levels) {
  return {{"name", cache_level_name(index, levels)},
          {"size_bytes", shape.bytes},
          {"ways", shape.ways},
          {"shared", levels > 1 && index + 1 == levels},
          {"accesses_count", counts.accesses},
          {"misses_count", counts.misses},
          {"write_backs_count", counts.write_backs}};
}

Json model_json(const LevelFigures& figures) {
  if (!figures.touches) return {{"available", false}, {"reason", figures.no_touches}};
  const TouchReport& report = *figures.touches;
  const uint64_t line = report.line_bytes;
  Json json = {{"available", true},
               {"levels_source", figures.cache_source},
               {"line_bytes", line},
               {"sets_modelled_one_in", report.cache.one_in},
               {"threads_count", figures.threads},
               {"seconds", figures.modelled_seconds}};
  for (size_t i = 0; i < report.levels.size(); ++i) {
    json["levels"].push_back(level_json(report.cache.levels[i], report.levels[i], i, report.levels.size()));
  }
  json["rays_count"] = figures.rays;
  json["memory_read_bytes"] = report.memory.fills * line;
  json["memory_written_bytes"] = report.memory.write_backs * line;
  json["memory_bytes_per_ray"] = per(report.memory.total() * line, figures.rays);
  json["treelet_lines_per_ray"] = per(report.treelet_lines, figures.rays);
  for (uint8_t kind = 0; kind < kTouchKindCount; ++kind) {
    const LineCounts& lines = report.by_kind[kind];
    if (lines.total() == 0) continue;
    json["memory_bytes_by_kind"][kTouchKindNames[kind]] = lines.total() * line;
  }
  return json;
}

Json lanes_json(const LaneUse& use) {
  return {{"active_lanes_count", use.active}, {"offered_lanes_count", use.offered}, {"share", use.share()}};
}

Json hardware_json(const LevelFigures& figures) {
  Json json = {{"available", figures.hardware_available}};
  if (!figures.hardware_reason.empty()) json["reason"] = figures.hardware_reason;
  for (size_t i = 0; i < kHardwareCounterCount; ++i) {
    if (figures.hardware[i]) json[kHardwareCounterNames[i]] = *figures.hardware[i];
  }
  return json;
}

class Table {
 public:
  explicit Table(const std::vector<LevelFigures>& columns) : columns_(columns) {}

  void row(const std::string& name, const std::function<std::string(const LevelFigures&)>& value) {
    text_ += fmt::format("{:<34}", name);
    for (const LevelFigures& column : columns_) text_ += fmt::format("{:>16}", value(column));
    text_ += "\n";
  }
  /// Of modelled runs; others have "absent".
  void model_row(const std::string& name,
                 const std::function<std::string(const TouchReport&, uint64_t rays)>& value) {
    row(name, [&](const LevelFigures& column) {
      return column.touches ? value(*column.touches, column.rays) : std::string("absent");
    });
  }
  void lane_row(const std::string& words, LaneUse LaneUses::*use) {
    const bool any = std::any_of(columns_.begin(), columns_.end(), [&](const LevelFigures& column) {
      return column.touches && (column.touches->lanes.*use).offered > 0;
    });
    if (!any) return;
    model_row("SIMD lanes in use: " + words, [&](const TouchReport& report, uint64_t) {
      const LaneUse& lanes = report.lanes.*use;
      return lanes.offered == 0 ? std::string("none") : fmt::format("{:.1f} %", 100 * lanes.share());
    });
  }
  const std::string& text() const { return text_; }

 private:
  const std::vector<LevelFigures>& columns_;
  std::string text_;
};

/// The first column that has a model says which levels there are.
void add_model_rows(const std::vector<LevelFigures>& columns, Table& table) {
  const auto modelled = std::find_if(columns.begin(), columns.end(),
                                     [](const LevelFigures& column) { return column.touches.has_value(); });
  if (modelled == columns.end()) {
    table.row("model of the caches", [](const LevelFigures&) { return std::string("absent"); });
    return;
  }
  table.model_row("treelet lines touched a ray", [](const TouchReport& report, uint64_t rays) {
    return fmt::format("{:.1f}", per(report.treelet_lines, rays));
  });
  const size_t levels = modelled->touches->levels.size();
  for (size_t i = 0; i < levels; ++i) {
    table.model_row(cache_level_name(i, levels) + " misses a ray (model)",
                    [&](const TouchReport& report, uint64_t rays) {
                      return fmt::format("{:.2f}", per(report.levels[i].misses, rays));
                    });
  }
  table.model_row("memory bytes a ray (model)", [](const TouchReport& report, uint64_t rays) {
    return fmt::format("{:.1f}", per(report.memory.total() * report.line_bytes, rays));
  });
#define SHOAL_ROW(member, name, words) table.lane_row(words, &LaneUses::member);
  SHOAL_LANE_USES(SHOAL_ROW)
#undef SHOAL_ROW
}

void add_hardware_rows(const std::vector<LevelFigures>& columns, Table& table) {
  const bool any = std::any_of(columns.begin(), columns.end(),
                               [](const LevelFigures& column) { return column.hardware_available; });
  if (!any) {
    table.row("hardware counters", [](const LevelFigures&) { return std::string("absent"); });
    return;
  }
  for (size_t i = 0; i < kHardwareCounterCount; ++i) {
    std::string name(kHardwareCounterNames[i]);
    name.resize(name.size() - std::string("_count").size());
    std::replace(name.begin(), name.end(), '_', ' ');
    table.row(name + " a ray (hardware)", [&](const LevelFigures& column) {
      return column.hardware[i] ? fmt::format("{:.2f}", per(*column.hardware[i], column.rays))
                                : std::string("absent");
    });
  }
}

}  // namespace

std::string levels_json(const LevelFigures& figures) {
  Json json;
  json["cache_model"] = model_json(figures);
  if (figures.touches) {
    json["treelet_lines_touched_count"] = figures.touches->treelet_lines;
    const LaneUses& lanes = figures.touches->lanes;
#define SHOAL_PUT(member, name, words) \
  if (lanes.member.offered > 0) json["simd_lane_occupancy"][name] = lanes_json(lanes.member);
    SHOAL_LANE_USES(SHOAL_PUT)
#undef SHOAL_PUT
  }
  json["hardware_counters"] = hardware_json(figures);
  return json.dump();
}

std::string levels_table(const std::vector<LevelFigures>& columns) {
  Table table(columns);
  add_model_rows(columns, table);
  add_hardware_rows(columns, table);
  return table.text();
}

}  // namespace shoal
