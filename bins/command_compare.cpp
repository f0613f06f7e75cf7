// shoal compare: the same picture in several orders, and what each of them moved.
#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "bins/choice_option.h"
#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

struct Arguments {
  RenderArguments render;
  std::vector<std::string> orders{"queued", "depth-first"};
  std::string out;
};

struct OrderResult {
  ExecutionOptions execution;
  RenderResult result;
};

Result<std::vector<OrderResult>> render_orders(const Arguments& arguments, PreparedRender& prepared,
                                               Console& console) {
  std::vector<OrderResult> results;
  for (const std::string& name : arguments.orders) {
    ExecutionOptions execution = prepared.execution;
    SHOAL_ASSIGN_OR_RETURN(execution.order, parse_order(name));
    RenderHooks hooks = console_hooks(console);
    hooks.planned = [&](const MemoryPlan& plan) { console.info(name + ": " + describe_plan(plan)); };
    auto result = render(posix_file_system(), prepared.scene, prepared.picture, execution, hooks);
    console.end_progress();
    if (!result.ok()) return std::move(result).error();
    results.push_back({execution, std::move(result).value()});
  }
  return results;
}

/// What can be said before the scene is read; makes the folder.
Status check_arguments(const Arguments& arguments) {
  for (const std::string& name : arguments.orders) SHOAL_RETURN_IF_ERROR(parse_order(name));
  std::error_code code;
  std::filesystem::create_directories(arguments.out, code);
  if (code) return Error{ErrorCode::kStorage, fmt::format("{}: cannot be made: {}", arguments.out, code.message())};
  return check_output(arguments.out + "/compare.json");
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

Status write_report(const Arguments& arguments, const PreparedRender& prepared,
                    const std::vector<OrderResult>& results, bool identical) {
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["pictures_identical"] = identical;
  for (const OrderResult& r : results) {
    json["orders"][std::string(order_name(r.execution.order))] =
        nlohmann::ordered_json::parse(stats_json(r.result, prepared.scene, prepared.picture, r.execution));
  }
  const std::string text = json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  return write_whole_file(posix_file_system(), arguments.out + "/compare.json", std::as_bytes(std::span(text)));
}

int run_compare(const Arguments& arguments, Console& console) {
  if (const Status status = check_arguments(arguments); !status.ok()) return console.error(status.error());
  std::vector<Order> orders;
  for (const std::string& name : arguments.orders) orders.push_back(parse_order(name).value());
  auto prepared = prepare_render(arguments.render, orders, console);
  if (!prepared.ok()) return console.error(prepared.error());
  auto results = render_orders(arguments, prepared.value(), console);
  if (!results.ok()) return console.error(results.error());
  bool identical = true;
  std::vector<TrafficColumn> columns;
  for (const OrderResult& r : results.value()) {
    identical = identical && same_bits(r.result.rgba, results.value().front().result.rgba);
    columns.push_back({std::string(order_name(r.execution.order)), &r.result});
  }
  const Status written = write_report(arguments, prepared.value(), results.value(), identical);
  if (!written.ok()) return console.error(written.error());
  fmt::print("{}", traffic_table(columns));
  fmt::print("{:<34}{:>16}\n", "pictures", identical ? "identical" : "DIFFERENT");
  if (identical) return 0;
  return console.error({ErrorCode::kInternal, "the orders gave different pictures: this is a bug"});
}

}  // namespace

void declare_compare(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("compare", "the same picture in several orders, and what each moved");
  arguments->render.declare(*sub);
  sub->add_option("--orders", arguments->orders, "comma-separated: " + choice_names(order_choices()))
      ->delimiter(',')
      ->capture_default_str();
  sub->add_option("--out", arguments->out, "folder for compare.json")->required();
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_compare(*arguments, console); };
  });
}

}  // namespace shoal
