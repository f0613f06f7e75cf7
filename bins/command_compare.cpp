// shoal compare: the same picture in several orders, and what each of them moved.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>

#include "bins/builder_option.h"
#include "bins/choice_option.h"
#include "bins/command.h"
#include "bins/compare_orders.h"
#include "bins/compare_report.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

/// What can be said before the scene is read; makes the folder.
Status check_arguments(const CompareArguments& arguments) {
  SHOAL_RETURN_IF_ERROR(check_compare_arguments(arguments));
  std::error_code code;
  std::filesystem::create_directories(arguments.out, code);
  if (code) return Error{ErrorCode::kStorage, fmt::format("{}: cannot be made: {}", arguments.out, code.message())};
  for (const char* name : {"/compare.json", "/compare.csv", "/timeline.csv", "/treelets.csv", "/report.html"}) {
    SHOAL_RETURN_IF_ERROR(check_output(arguments.out + name));
  }
  return {};
}

Status write_text(const std::string& path, const std::string& text) {
  return write_whole_file(posix_file_system(), path, std::as_bytes(std::span(text)));
}

Status write_report(const CompareArguments& arguments, const Comparison& comparison) {
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["scene_asked"] = arguments.render.scene;
  json["pictures_identical"] = comparison.identical;
  json["runs_count"] = arguments.runs;
  for (const OrderResult& order : comparison.orders) {
    auto& stats = json["orders"][order.label];
    stats = nlohmann::ordered_json::parse(order.median().stats);
    stats.update(nlohmann::ordered_json::parse(levels_json(order.levels)));
    for (const OrderRun& run : order.runs) stats["run_seconds"].push_back(run.result.seconds);
  }
  if (comparison.kinds) {
    json["ray_kinds"] = nlohmann::ordered_json::parse(kinds_json(*comparison.kinds));
    SHOAL_RETURN_IF_ERROR(write_text(arguments.out + "/kinds.csv", kinds_csv(*comparison.kinds)));
  }
  CompareReport report{json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace), {}, comparison.pictures,
                       own_command_line()};
  for (const OrderResult& order : comparison.orders) report.courses.emplace_back(order.label, order.course);
  return write_compare_report(posix_file_system(), arguments.out, report);
}

void print(const Comparison& comparison) {
  std::vector<TrafficColumn> columns;
  std::vector<LevelFigures> levels;
  for (const OrderResult& order : comparison.orders) {
    columns.push_back({order.label, &order.median().result});
    levels.push_back(order.levels);
  }
  fmt::print("{}{}", traffic_table(columns), levels_table(levels));
  fmt::print("{:<34}{:>16}\n", "pictures", comparison.identical ? "identical" : "DIFFERENT");
  if (comparison.kinds) fmt::print("{}", kinds_text(*comparison.kinds));
}

int run_compare(const CompareArguments& arguments, Console& console) {
  if (const Status status = check_arguments(arguments); !status.ok()) return console.error(status.error());
  const auto compared = compare_orders(arguments, console);
  if (!compared.ok()) return console.error(compared.error());
  const Comparison& comparison = compared.value();
  const Status written = write_report(arguments, comparison);
  if (!written.ok()) return console.error(written.error());
  print(comparison);
  if (!comparison.identical) {
    return console.error({ErrorCode::kInternal, "the orders gave different pictures: this is a bug"});
  }
  if (comparison.kinds && !comparison.kinds->identical()) {
    return console.error({ErrorCode::kInternal, "the orders gave different hits to the same rays: this is a bug"});
  }
  return 0;
}

}  // namespace

void declare_compare(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<CompareArguments>();
  CLI::App* sub = app.add_subcommand("compare", "the same picture in several orders, and what each moved");
  arguments->render.declare(*sub);
  sub->add_option("--orders", arguments->orders,
                  "comma-separated, queued also with its policy (queued:full): " + choice_names(order_choices()))
      ->delimiter(',')
      ->capture_default_str();
  sub->add_option("--builders", arguments->builders,
                  "comma-separated: sah, lbvh, karras; every order over the trees of each builder, as lbvh/queued "
                  "(of a .gltf or .glb only)")
      ->delimiter(',');
  sub->add_option("--out", arguments->out, "folder for report.html, compare.json and CSV files")->required();
  sub->add_option("--runs", arguments->runs, "of each order, in turns; the one of median time is shown")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  arguments->kinds.declare(*sub);
  arguments->levels.declare(*sub);
  sub->add_flag("--trace", arguments->trace,
                "a trace of each order's first run as well, trace-ORDER.json, for Perfetto (docs/compare.md)");
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_compare(*arguments, console); };
  });
}

}  // namespace shoal
