// The table kind of ray x order of `shoal compare --kinds`: its options, its figures as JSON, CSV and text. Called by
// bins/command_compare.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bins/order_choice.h"
#include "bins/render_options.h"
#include "engine/ray_kinds.h"

namespace shoal {

/// Options as they stand on the command line.
struct KindArguments {
  std::vector<std::string> kinds;  ///< empty: no table
  std::string rays = "64K";

  void declare(CLI::App& app);
  bool asked() const { return !kinds.empty(); }
};

/// Fails with: kUsage.
Result<KindOptions> parse_kinds(const KindArguments& arguments, uint32_t runs);

struct KindTable {
  TakenKinds taken;           ///< without its rays
  std::vector<KindRow> rows;
  std::vector<std::string> labels;  ///< of the orders of each row

  bool identical() const;
  /// The orders of the same rays over another tree. Requires: the same kinds.
  void append(KindTable other);
};

/// Whether the cap has room for that, before anything is rendered. Fails with: kMemoryCap.
Status check_kinds(const PreparedRender& prepared, const std::vector<OrderChoice>& orders, const KindOptions& options);

/// Takes the rays and traces them in each of the orders, with progress. Fails with: what take_kinds() and trace_kinds()
/// fail with.
Result<KindTable> compare_kinds(const PreparedRender& prepared, const std::vector<OrderChoice>& orders,
                                const KindOptions& options, Console& console);

/// `ray_kinds` of compare.json, JSON text.
std::string kinds_json(const KindTable& table);
/// A line a kind and order, and a head.
std::string kinds_csv(const KindTable& table);
/// The same for people.
std::string kinds_text(const KindTable& table);

}  // namespace shoal
