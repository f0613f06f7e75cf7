// Traffic at each level of one order of `shoal compare`, as JSON and as rows for people: what a modelled run
// (engine/touch_recorder) and the processor's own counters (engine/hardware_counters) say. Called by bins. Plain
// functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/cache_levels.h"
#include "engine/hardware_counters.h"
#include "engine/touch_recorder.h"

namespace shoal {

/// Of one order.
struct LevelFigures {
  std::string title;
  uint64_t rays = 0;                   ///< of the run shown; of any run of this picture
  std::optional<TouchReport> touches;  ///< of the modelled run
  std::string no_touches;              ///< why there are none
  std::string cache_source;            ///< CacheLevels::source
  unsigned threads = 0;                ///< of the modelled run, as the next
  double modelled_seconds = 0;
  bool hardware_available = false;
  std::string hardware_reason;  ///< HardwareCounters::reason()
  HardwareCounts hardware;      ///< of the run shown
};

/// {"cache_model": {...}, "treelet_lines_touched_count": n, "simd_lane_occupancy": {...}, "hardware_counters":
/// {...}} as JSON text; the second and third only of a modelled run.
std::string levels_json(const LevelFigures& figures);

/// Rows of the traffic table (engine/render_report.h), a column each.
std::string levels_table(const std::vector<LevelFigures>& columns);

}  // namespace shoal
