#include "bins/compare_orders.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <utility>

#include "bins/builder_option.h"
#include "engine/find_scenes.h"
#include "engine/hardware_counters.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

/// Of pictures on the page.
constexpr uint32_t kMostSide = 480;

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

class OrderComparison {
 public:
  OrderComparison(const CompareArguments& arguments, std::vector<OrderChoice> choices, Console& console)
      : arguments_(arguments), choices_(std::move(choices)), console_(console), builders_(arguments.builders) {
    if (builders_.empty()) builders_.emplace_back();
  }

  Status run() {
    for (uint32_t run = 0; run < arguments_.runs; ++run) {
      for (const std::string& builder : builders_) {
        SHOAL_RETURN_IF_ERROR(open(builder));
        SHOAL_RETURN_IF_ERROR(render_turn(run == 0));
      }
    }
    for (const std::string& builder : builders_) {
      SHOAL_RETURN_IF_ERROR(open(builder));
      SHOAL_RETURN_IF_ERROR(look_closer());
    }
    return {};
  }

  Comparison result;

 private:
  /// The scene by this builder, ready to render; no builder: as the options have it.
  Status open(const std::string& builder) {
    if (prepared_ && builder == builder_) return {};
    prepared_.reset();
    builder_ = builder;
    std::vector<Order> orders;
    for (const OrderChoice& choice : choices_) orders.push_back(choice.order);
    RenderArguments render = arguments_.render;
    render.execution.record = &record_;  // for the plan
    if (!builder.empty()) {
      SHOAL_ASSIGN_OR_RETURN(render.builder, parse_builder(builder));
    }
    const size_t pictures = orders.size() * builders_.size() * (arguments_.runs + (arguments_.levels.model ? 1 : 0));
    auto prepared = prepare_render(render, orders, pictures > 1 ? 1 : 0, console_);
    if (!prepared.ok()) return std::move(prepared).error();
    prepared_.emplace(std::move(prepared).value());
    prepared_->execution.record = nullptr;  // of first runs only
    if (!arguments_.kinds.asked()) return {};
    return check_kinds(*prepared_, choices_, parse_kinds(arguments_.kinds, arguments_.runs).value());
  }

  std::string label_of(const OrderChoice& choice) const {
    return builder_.empty() ? choice.label : builder_ + "/" + choice.label;
  }

  OrderResult& order_of(const std::string& label) {
    for (OrderResult& order : result.orders) {
      if (order.label == label) return order;
    }
    result.orders.emplace_back().label = label;
    return result.orders.back();
  }

  ExecutionOptions execution_of(const OrderChoice& choice) const {
    ExecutionOptions execution = prepared_->execution;
    choice.apply(execution);
    return execution;
  }

  /// Of the pictures only the first is kept.
  void compare_picture(std::vector<float> picture) {
    if (first_.empty()) {
      first_ = std::move(picture);
    } else {
      result.identical = result.identical && same_bits(picture, first_);
    }
  }

  /// Where the trace of an order goes: its label, but what may stand in no name of a file.
  std::string trace_path(std::string label) const {
    for (char& c : label) c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '-';
    return arguments_.out + "/trace-" + label + ".json";
  }

  Status render_turn(bool first_run) {
    for (const OrderChoice& choice : choices_) {
      const std::string label = label_of(choice);
      OrderResult& order = order_of(label);
      ExecutionOptions execution = execution_of(choice);
      if (first_run) execution.record = &record_;
      if (first_run && arguments_.trace) {
        SHOAL_RETURN_IF_ERROR(record_.open_trace(posix_file_system(), trace_path(label)));
      }
      RenderHooks hooks = console_hooks(console_);
      hooks.planned = [&](const MemoryPlan& plan) { console_.info(label + ": " + describe_plan(plan)); };
      const HardwareCounts before = hardware_.read();
      auto rendered = render(posix_file_system(), prepared_->scene, prepared_->picture, execution, hooks);
      const HardwareCounts counts = difference(hardware_.read(), before);
      console_.end_progress();
      const Status traced = first_run ? record_.finish_trace() : Status{};
      if (!rendered.ok()) return std::move(rendered).error();
      SHOAL_RETURN_IF_ERROR(traced);
      keep(label, std::move(rendered).value(), execution, counts, first_run, order);
    }
    return {};
  }

  void keep(const std::string& label, RenderResult rendered, const ExecutionOptions& execution, const HardwareCounts& counts,
            bool first_run, OrderResult& order) {
    std::vector<float> picture = std::exchange(rendered.rgba, {});
    if (first_run) {
      order.course = record_.take_course();
      result.pictures.push_back(compare_pictures(label, picture, first_.empty() ? picture : first_, prepared_->picture.width,
                                                 prepared_->picture.height, kMostSide));
    }
    compare_picture(std::move(picture));
    std::string stats = stats_json(rendered, prepared_->scene, prepared_->picture, execution);
    order.runs.push_back({std::move(rendered), std::move(stats), counts});
  }

  /// After all runs, which know nothing of it: the model of the caches, and the kinds of rays.
  Status look_closer() {
    for (const OrderChoice& choice : choices_) {
      OrderResult& order = order_of(label_of(choice));
      order.levels.title = order.label;
      order.levels.rays = order.median().result.counters.total().rays_traced_count;
      order.levels.hardware_available = hardware_.available();
      order.levels.hardware_reason = hardware_.reason();
      order.levels.hardware = order.median().hardware;
      SHOAL_ASSIGN_OR_RETURN(std::vector<float> picture, model_order(arguments_.levels, *prepared_, execution_of(choice),
                                                                     console_, order.levels));
      if (!picture.empty()) compare_picture(std::move(picture));
    }
    if (!arguments_.kinds.asked()) return {};
    const KindOptions options = parse_kinds(arguments_.kinds, arguments_.runs).value();
    SHOAL_ASSIGN_OR_RETURN(KindTable table, compare_kinds(*prepared_, choices_, options, console_));
    for (size_t i = 0; i < choices_.size(); ++i) table.labels[i] = label_of(choices_[i]);
    if (result.kinds) {
      result.kinds->append(std::move(table));
    } else {
      result.kinds = std::move(table);
    }
    return {};
  }

  const CompareArguments& arguments_;
  const std::vector<OrderChoice> choices_;
  Console& console_;
  const HardwareCounters hardware_;  ///< made before the first thread is started
  std::vector<std::string> builders_;
  std::string builder_;  ///< of what is open
  std::optional<PreparedRender> prepared_;
  RenderRecord record_;
  std::vector<float> first_;  ///< the first picture
};

}  // namespace

const OrderRun& OrderResult::median() const {
  std::vector<const OrderRun*> by_time;
  for (const OrderRun& run : runs) by_time.push_back(&run);
  const auto middle = by_time.begin() + static_cast<ptrdiff_t>((by_time.size() - 1) / 2);
  std::nth_element(by_time.begin(), middle, by_time.end(),
                   [](const OrderRun* a, const OrderRun* b) { return a->result.seconds < b->result.seconds; });
  return **middle;
}

Status check_compare_arguments(const CompareArguments& arguments) {
  SHOAL_RETURN_IF_ERROR(parse_order_choices(arguments.orders));
  for (const std::string& name : arguments.builders) SHOAL_RETURN_IF_ERROR(parse_builder(name));
  if (!arguments.builders.empty() && is_shoal_path(arguments.render.scene)) {
    return Error{ErrorCode::kUsage, "--builders is of a .gltf or .glb: a .shoal has the trees it was built with"};
  }
  if (!arguments.builders.empty() && arguments.render.builder) {
    return Error{ErrorCode::kUsage, "--builder and --builders: expected one of them"};
  }
  if (auto kinds = parse_kinds(arguments.kinds, arguments.runs); !kinds.ok()) return std::move(kinds).error();
  SHOAL_RETURN_IF_ERROR(arguments.levels.options(0));
  return {};
}

Result<Comparison> compare_orders(const CompareArguments& arguments, Console& console) {
  SHOAL_ASSIGN_OR_RETURN(std::vector<OrderChoice> choices, parse_order_choices(arguments.orders));
  OrderComparison comparison(arguments, std::move(choices), console);
  SHOAL_RETURN_IF_ERROR(comparison.run());
  return std::move(comparison.result);
}

}  // namespace shoal
