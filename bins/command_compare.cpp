// shoal compare: the same picture in several orders, and what each of them moved.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>

#include "bins/choice_option.h"
#include "bins/command.h"
#include "bins/compare_kinds.h"
#include "bins/compare_levels.h"
#include "bins/compare_report.h"
#include "bins/order_choice.h"
#include "bins/render_options.h"
#include "engine/render_record.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

struct Arguments {
  RenderArguments render;
  std::vector<std::string> orders{"queued", "depth-first"};
  std::string out;
  uint32_t runs = 1;
  KindArguments kinds;
  LevelArguments levels;
  bool trace = false;
};

struct OrderResult {
  std::string label;
  ExecutionOptions execution;
  std::vector<RenderResult> runs;  ///< without pictures
  std::vector<HardwareCounts> hardware{};  ///< of each run
  LevelFigures levels{};
  RenderCourse course{};             ///< of the first

  /// The run that took the median time; of an even number, the faster of the two in the middle.
  const RenderResult& median() const {
    std::vector<const RenderResult*> by_time;
    for (const RenderResult& run : runs) by_time.push_back(&run);
    const auto middle = by_time.begin() + static_cast<ptrdiff_t>((by_time.size() - 1) / 2);
    std::nth_element(by_time.begin(), middle, by_time.end(),
                     [](const RenderResult* a, const RenderResult* b) { return a->seconds < b->seconds; });
    return **middle;
  }
};

struct Comparison {
  std::vector<OrderResult> orders;
  bool identical = true;  ///< every picture has the bits of the first
  std::vector<ComparedPicture> pictures;
};

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// Of pictures on the page; of the first run.
constexpr uint32_t kMostSide = 480;

/// Where the trace of an order goes: its label, but what may stand in no name of a file.
std::string trace_path(const Arguments& arguments, std::string label) {
  for (char& c : label) c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '-';
  return arguments.out + "/trace-" + label + ".json";
}

/// The orders take turns, so that what else the machine does disturbs all alike. Of the pictures only the first is kept.
Result<Comparison> render_orders(const Arguments& arguments, PreparedRender& prepared, const HardwareCounters& hardware,
                                 RenderRecord& record, Console& console) {
  Comparison comparison;
  std::vector<float> first;
  const auto compare_picture = [&](std::vector<float> picture) {
    if (first.empty()) {
      first = std::move(picture);
    } else {
      comparison.identical = comparison.identical && same_bits(picture, first);
    }
  };
  SHOAL_ASSIGN_OR_RETURN(const std::vector<OrderChoice> choices, parse_order_choices(arguments.orders));
  for (const OrderChoice& choice : choices) {
    comparison.orders.push_back({choice.label, prepared.execution, {}});
    choice.apply(comparison.orders.back().execution);
  }
  for (uint32_t run = 0; run < arguments.runs; ++run) {
    for (OrderResult& order : comparison.orders) {
      RenderHooks hooks = console_hooks(console);
      hooks.planned = [&](const MemoryPlan& plan) { console.info(order.label + ": " + describe_plan(plan)); };
      ExecutionOptions execution = order.execution;
      if (run == 0) execution.record = &record;
      if (run == 0 && arguments.trace) {
        SHOAL_RETURN_IF_ERROR(record.open_trace(posix_file_system(), trace_path(arguments, order.label)));
      }
      const HardwareCounts before = hardware.read();
      auto result = render(posix_file_system(), prepared.scene, prepared.picture, execution, hooks);
      order.hardware.push_back(difference(hardware.read(), before));
      console.end_progress();
      const Status traced = run == 0 ? record.finish_trace() : Status{};
      if (!result.ok()) return std::move(result).error();
      SHOAL_RETURN_IF_ERROR(traced);
      if (run == 0) order.course = record.take_course();
      std::vector<float> picture = std::exchange(result.value().rgba, {});
      if (run == 0) {
        comparison.pictures.push_back(compare_pictures(order.label, picture, first.empty() ? picture : first,
                                                       prepared.picture.width, prepared.picture.height, kMostSide));
      }
      compare_picture(std::move(picture));
      order.runs.push_back(std::move(result).value());
    }
  }
  for (OrderResult& order : comparison.orders) {
    const RenderResult& shown = order.median();
    order.levels.title = order.label;
    order.levels.rays = shown.counters.total().rays_traced_count;
    order.levels.hardware_available = hardware.available();
    order.levels.hardware_reason = hardware.reason();
    order.levels.hardware = order.hardware[static_cast<size_t>(&shown - order.runs.data())];
    SHOAL_ASSIGN_OR_RETURN(std::vector<float> picture, model_order(arguments.levels, prepared, order.execution, console,
                                                                   order.levels));
    if (!picture.empty()) compare_picture(std::move(picture));
  }
  return comparison;
}

/// What can be said before the scene is read; makes the folder.
Status check_arguments(const Arguments& arguments) {
  SHOAL_RETURN_IF_ERROR(parse_order_choices(arguments.orders));
  if (auto kinds = parse_kinds(arguments.kinds, arguments.runs); !kinds.ok()) return std::move(kinds).error();
  SHOAL_RETURN_IF_ERROR(arguments.levels.options());
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

Status write_report(const Arguments& arguments, const PreparedRender& prepared, const Comparison& comparison,
                    const std::optional<KindTable>& kinds) {
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["pictures_identical"] = comparison.identical;
  json["runs_count"] = arguments.runs;
  for (const OrderResult& order : comparison.orders) {
    auto& stats = json["orders"][order.label];
    stats = nlohmann::ordered_json::parse(
        stats_json(order.median(), prepared.scene, prepared.picture, order.execution));
    stats.update(nlohmann::ordered_json::parse(levels_json(order.levels)));
    for (const RenderResult& run : order.runs) stats["run_seconds"].push_back(run.seconds);
  }
  if (kinds) {
    json["ray_kinds"] = nlohmann::ordered_json::parse(kinds_json(*kinds));
    SHOAL_RETURN_IF_ERROR(write_text(arguments.out + "/kinds.csv", kinds_csv(*kinds)));
  }
  CompareReport report{json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace), {}, comparison.pictures,
                       own_command_line()};
  for (const OrderResult& order : comparison.orders) report.courses.emplace_back(order.label, order.course);
  return write_compare_report(posix_file_system(), arguments.out, report);
}

int run_compare(const Arguments& arguments, Console& console) {
  if (const Status status = check_arguments(arguments); !status.ok()) return console.error(status.error());
  const HardwareCounters hardware;  // before the first thread is started
  std::vector<Order> orders;
  const std::vector<OrderChoice> choices = parse_order_choices(arguments.orders).value();
  for (const OrderChoice& choice : choices) orders.push_back(choice.order);
  const size_t renders = orders.size() * (arguments.runs + (arguments.levels.model ? 1 : 0));
  RenderRecord record;
  RenderArguments asked = arguments.render;
  asked.execution.record = &record;  // for the plan
  auto prepared = prepare_render(asked, orders, renders > 1 ? 1 : 0, console);
  if (!prepared.ok()) return console.error(prepared.error());
  prepared.value().execution.record = nullptr;  // of first runs only
  std::optional<KindOptions> kinds_asked;
  if (arguments.kinds.asked()) {
    kinds_asked = parse_kinds(arguments.kinds, arguments.runs).value();
    const Status fits = check_kinds(prepared.value(), choices, *kinds_asked);
    if (!fits.ok()) return console.error(fits.error());
  }
  const auto compared = render_orders(arguments, prepared.value(), hardware, record, console);
  if (!compared.ok()) return console.error(compared.error());
  const Comparison& comparison = compared.value();
  std::vector<TrafficColumn> columns;
  for (const OrderResult& order : comparison.orders) {
    columns.push_back({order.label, &order.median()});
  }
  std::optional<KindTable> kinds;
  if (kinds_asked) {
    auto table = compare_kinds(prepared.value(), choices, *kinds_asked, console);
    if (!table.ok()) return console.error(table.error());
    kinds = std::move(table).value();
  }
  const Status written = write_report(arguments, prepared.value(), comparison, kinds);
  if (!written.ok()) return console.error(written.error());
  std::vector<LevelFigures> levels;
  for (const OrderResult& order : comparison.orders) levels.push_back(order.levels);
  fmt::print("{}{}", traffic_table(columns), levels_table(levels));
  fmt::print("{:<34}{:>16}\n", "pictures", comparison.identical ? "identical" : "DIFFERENT");
  if (kinds) fmt::print("{}", kinds_text(*kinds));
  if (!comparison.identical) {
    return console.error({ErrorCode::kInternal, "the orders gave different pictures: this is a bug"});
  }
  if (kinds && !kinds->identical()) {
    return console.error({ErrorCode::kInternal, "the orders gave different hits to the same rays: this is a bug"});
  }
  return 0;
}

}  // namespace

void declare_compare(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("compare", "the same picture in several orders, and what each moved");
  arguments->render.declare(*sub);
  sub->add_option("--orders", arguments->orders,
                  "comma-separated, queued also with its policy (queued:full): " + choice_names(order_choices()))
      ->delimiter(',')
      ->capture_default_str();
  sub->add_option("--out", arguments->out, "folder for report.html, compare.json and .csv")->required();
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
