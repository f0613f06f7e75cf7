// What `shoal compare` renders: the same picture in several orders, over the trees of several builders where they are asked
// for, in turns; once more in each for the model of the caches, and the kinds of rays apart where they are asked for. Called
// by bins/command_compare, which reports it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bins/compare_kinds.h"
#include "bins/compare_levels.h"
#include "bins/compare_pictures.h"
#include "bins/order_choice.h"
#include "bins/render_options.h"
#include "engine/render_record.h"

namespace shoal {

struct CompareArguments {
  RenderArguments render;
  std::vector<std::string> orders{"queued", "depth-first"};
  std::vector<std::string> builders;  ///< none: that of the scene, and labels do not name it
  std::string out;
  uint32_t runs = 1;
  KindArguments kinds;
  LevelArguments levels;
  bool trace = false;
};

struct OrderRun {
  RenderResult result;      ///< without the picture
  std::string stats;        ///< what --stats would say
  HardwareCounts hardware;
};

struct OrderResult {
  std::string label;  ///< "queued"; of one builder among several "lbvh/queued"
  std::vector<OrderRun> runs;
  LevelFigures levels;
  RenderCourse course;  ///< of the first run

  /// The run that took the median time; of an even number, the faster of the two in the middle.
  const OrderRun& median() const;
};

struct Comparison {
  std::vector<OrderResult> orders;
  std::vector<ComparedPicture> pictures;  ///< of first runs
  std::optional<KindTable> kinds;
  bool identical = true;  ///< every picture has the bits of the first
};

/// What can be said before the scene is read. Fails with: kUsage.
Status check_compare_arguments(const CompareArguments& arguments);

/// Orders take turns, so that what else the machine does disturbs all alike. So do builders, of which one scene at a time is
/// open: each has the whole cap. Fails with: what building and rendering fail with.
Result<Comparison> compare_orders(const CompareArguments& arguments, Console& console);

}  // namespace shoal
