// What `shoal compare` leaves in its folder: compare.json, the same figures as CSV (compare.csv; over time timeline.csv; by
// treelet treelets.csv), and report.html (bins/compare_page). Called by bins/command_compare when all orders are rendered.
//
// Orders are known by their labels only: whatever stands under "orders" in the document is reported, and what it says
// beyond what is known here (a "cache_model" of an order, "ray_kinds") is shown as docs/compare.md says.
#pragma once

#include <string>
#include <vector>

#include "bins/compare_pictures.h"
#include "engine/render_record.h"
#include "io/result.h"

namespace shoal {

struct CompareReport {
  /// The document so far, a JSON object: "orders" with a `--stats` document a label, "pictures_identical", ...
  std::string json;
  std::vector<std::pair<std::string, RenderCourse>> courses;  ///< by label
  std::vector<ComparedPicture> pictures;
  std::vector<std::string> command_line;
};

/// The words that this process was started with, the first without its folders.
std::vector<std::string> own_command_line();

/// Fails with: kStorage, kInternal (a picture cannot be packed).
Status write_compare_report(FileSystem& fs, const std::string& folder, const CompareReport& report);

}  // namespace shoal
