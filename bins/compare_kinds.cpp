#include "bins/compare_kinds.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/clock.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

std::vector<ExecutionOptions> executions_of(const PreparedRender& prepared, const std::vector<OrderChoice>& orders) {
  std::vector<ExecutionOptions> executions(orders.size(), prepared.execution);
  for (size_t i = 0; i < orders.size(); ++i) orders[i].apply(executions[i]);
  return executions;
}

std::string_view name_of(RayBirth birth) { return kRayBirthNames[static_cast<size_t>(birth)]; }

double a_ray(uint64_t count, const KindFigures& figures) {
  return static_cast<double>(count) / static_cast<double>(figures.rays_count);
}

double million_rays_a_second(const KindFigures& figures) {
  return static_cast<double>(figures.rays_count) / figures.seconds * 1e-6;
}

/// Infinite where nothing was loaded; 0 in files.
double rays_a_load(const KindFigures& figures) {
  return static_cast<double>(figures.rays_count) / static_cast<double>(figures.treelet_loads_count);
}

/// The columns of a kind in an order: name and value. Those of JSON and CSV.
std::vector<std::pair<const char*, double>> columns_of(const KindInOrder& order) {
  const KindFigures& cold = order.cold();
  const KindFigures& warm = order.warm();
  return {{"rays_count", static_cast<double>(cold.rays_count)},
          {"hits_count", static_cast<double>(cold.hits_count)},
          {"seconds", cold.seconds},
          {"million_rays_a_second", million_rays_a_second(cold)},
          {"warm_seconds", warm.seconds},
          {"warm_million_rays_a_second", million_rays_a_second(warm)},
          {"node_tests_a_ray", a_ray(cold.node_tests_count, cold)},
          {"triangle_tests_a_ray", a_ray(cold.triangle_tests_count, cold)},
          {"treelet_visits_a_ray", a_ray(cold.treelet_visits_count, cold)},
          {"treelet_loads_count", static_cast<double>(cold.treelet_loads_count)},
          {"treelet_loads_a_ray", a_ray(cold.treelet_loads_count, cold)},
          {"rays_a_load", cold.treelet_loads_count > 0 ? rays_a_load(cold) : 0.0},
          {"disk_read_bytes", static_cast<double>(cold.disk_read_bytes)},
          {"disk_bytes_a_ray", a_ray(cold.disk_read_bytes, cold)},
          {"warm_treelet_loads_count", static_cast<double>(warm.treelet_loads_count)},
          {"warm_disk_bytes_a_ray", a_ray(warm.disk_read_bytes, warm)}};
}

bool is_count(std::string_view name) { return name.ends_with("_count") || name.ends_with("_bytes"); }

}  // namespace

void KindArguments::declare(CLI::App& app) {
  std::string names = "all";
  for (const std::string_view name : kRayBirthNames) names += fmt::format(", {}", name);
  app.add_option("--kinds", kinds,
                 "trace kinds of rays apart from each other in each order as well, bounce by bounce: a table kind x order. "
                 "Comma-separated: " + names)
      ->delimiter(',')
      ->type_name("LIST");
  app.add_option("--kind-rays", rays, "rays of each kind and bounce, at most: of whole tiles, of the first samples")
      ->type_name("COUNT")
      ->capture_default_str();
}

Result<KindOptions> parse_kinds(const KindArguments& arguments, uint32_t runs) {
  KindOptions options;
  options.runs = runs;
  const auto rays = parse_size(arguments.rays);
  if (!rays.ok()) return Error{ErrorCode::kUsage, "--kind-rays: " + rays.error().message};
  options.rays = rays.value();
  for (const std::string& name : arguments.kinds) {
    if (name == "all") {
      options.births.clear();
      return options;
    }
    const auto at = std::find(kRayBirthNames.begin(), kRayBirthNames.end(), name);
    if (at == kRayBirthNames.end()) {
      return Error{ErrorCode::kUsage, fmt::format("unknown kind of ray '{}': expected all or one of {}", name,
                                                  fmt::join(kRayBirthNames, ", "))};
    }
    options.births.push_back(static_cast<RayBirth>(at - kRayBirthNames.begin()));
  }
  return options;
}

bool KindTable::identical() const {
  return std::all_of(rows.begin(), rows.end(), [](const KindRow& row) { return row.identical; });
}

void KindTable::append(KindTable other) {
  SHOAL_CHECK(rows.size() == other.rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    SHOAL_CHECK(rows[i].birth == other.rows[i].birth && rows[i].bounce == other.rows[i].bounce);
    rows[i].identical = rows[i].identical && other.rows[i].identical;
    for (KindInOrder& order : other.rows[i].orders) rows[i].orders.push_back(std::move(order));
  }
  for (std::string& label : other.labels) labels.push_back(std::move(label));
}

Status check_kinds(const PreparedRender& prepared, const std::vector<OrderChoice>& orders, const KindOptions& options) {
  return check_kinds_fit(posix_file_system(), prepared.scene, prepared.picture, executions_of(prepared, orders), options);
}

Result<KindTable> compare_kinds(const PreparedRender& prepared, const std::vector<OrderChoice>& orders,
                                const KindOptions& options, Console& console) {
  const double start = now_seconds();
  RenderHooks hooks;
  hooks.stop = stop_on_signals();
  console.info(fmt::format("taking rays of each kind: at most {} of each bounce", options.rays));
  KindTable table;
  for (const OrderChoice& order : orders) table.labels.push_back(order.label);
  SHOAL_ASSIGN_OR_RETURN(table.taken, take_kinds(posix_file_system(), prepared.scene, prepared.picture,
                                                 prepared.execution, options, hooks));
  const auto done = [&](size_t rows, size_t of) {
    console.show_progress("kinds of rays", static_cast<double>(rows) / static_cast<double>(of), now_seconds() - start,
                          fmt::format("{} of {} lists", rows, of));
  };
  auto rows = trace_kinds(posix_file_system(), prepared.scene, table.taken, prepared.picture.shading,
                          executions_of(prepared, orders), options.runs, done, hooks);
  console.end_progress();
  if (!rows.ok()) return std::move(rows).error();
  table.rows = std::move(rows).value();
  table.taken.kinds.clear();
  return table;
}

std::string kinds_json(const KindTable& table) {
  Json list = Json::array();
  for (const KindRow& row : table.rows) {
    Json json;
    json["kind"] = name_of(row.birth);
    json["bounce"] = row.bounce;
    json["rays_count"] = row.rays_count;
    json["hits_identical"] = row.identical;
    for (size_t i = 0; i < row.orders.size(); ++i) {
      const KindInOrder& order = row.orders[i];
      Json& figures = json["orders"][table.labels[i]];
      for (const auto& [name, value] : columns_of(order)) {
        if (is_count(name)) {
          figures[name] = static_cast<uint64_t>(value);
        } else {
          figures[name] = value;
        }
      }
      for (const KindRun& run : order.runs) {
        figures["run_seconds"].push_back(run.cold.seconds);
        figures["warm_run_seconds"].push_back(run.warm.seconds);
      }
    }
    list.push_back(std::move(json));
  }
  return list.dump();
}

std::string kinds_csv(const KindTable& table) {
  std::string text;
  for (const KindRow& row : table.rows) {
    for (size_t i = 0; i < row.orders.size(); ++i) {
      const KindInOrder& order = row.orders[i];
      const auto columns = columns_of(order);
      if (text.empty()) {
        text = "kind,bounce,order";
        for (const auto& [name, value] : columns) text += fmt::format(",{}", name);
        text += "\n";
      }
      text += fmt::format("{},{},{}", name_of(row.birth), row.bounce, table.labels[i]);
      for (const auto& [name, value] : columns) {
        text += is_count(name) ? fmt::format(",{}", static_cast<uint64_t>(value)) : fmt::format(",{:.6g}", value);
      }
      text += "\n";
    }
  }
  return text;
}

std::string kinds_text(const KindTable& table) {
  std::string text = fmt::format("\nkinds of rays: {} paths, {} samples a pixel of one in {} tiles\n", table.taken.paths_count,
                                 table.taken.samples, table.taken.tile_sample);
  text += fmt::format("{:<14}{:>3}{:>9}  {:<24}{:>9}{:>9}{:>8}{:>8}{:>8}{:>12}{:>10}\n", "kind", "at", "rays", "order",
                      "Mrays/s", "warm", "nodes", "tris", "visits", "bytes a ray", "rays/load");
  for (const KindRow& row : table.rows) {
    std::string kind = fmt::format("{:<14}{:>3}{:>9}", name_of(row.birth), row.bounce, row.rays_count);
    for (size_t i = 0; i < row.orders.size(); ++i) {
      const KindInOrder& order = row.orders[i];
      const KindFigures& cold = order.cold();
      text += fmt::format("{:<26}  {:<24}{:>9.3f}{:>9.3f}{:>8.1f}{:>8.1f}{:>8.2f}{:>12.0f}{:>10}\n", kind,
                          table.labels[i], million_rays_a_second(cold), million_rays_a_second(order.warm()),
                          a_ray(cold.node_tests_count, cold), a_ray(cold.triangle_tests_count, cold),
                          a_ray(cold.treelet_visits_count, cold), a_ray(cold.disk_read_bytes, cold),
                          cold.treelet_loads_count > 0 ? fmt::format("{:.1f}", rays_a_load(cold)) : "-");
      kind.clear();
    }
  }
  return text + fmt::format("{:<34}{:>16}\n", "their hits", table.identical() ? "identical" : "DIFFERENT");
}

}  // namespace shoal
