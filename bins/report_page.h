// A report as one page of HTML that needs nothing else: text, tables, plots and pictures, readable in light, in dark and on
// paper, without a network. Called by the commands that write reports; what is theirs stays with them. Its look is in
// bins/report/theme.css; its plots are drawn by bins/report/plots.js and bars.js with uPlot, heat maps by heat.js.
//
// Texts are plain: they are escaped here. Numbers in tables carry their full precision as data-value.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "io/result.h"

namespace shoal {

/// Below the heading of a section.
struct ReportHeading {
  std::string text;
};

struct ReportText {
  std::string text;
};

struct ReportList {
  std::vector<std::string> items;
};

struct ReportCell {
  std::string text;
  std::optional<double> value = {};
  std::string path = {};  ///< JSON pointer of the value in the document that the page carries, or empty
};
struct ReportTable {
  struct Row {
    std::vector<ReportCell> cells;
    bool marked = false;
  };
  std::vector<std::string> head;
  std::vector<Row> rows;
  std::string caption;
};

struct ReportSeries {
  std::string label;
  std::vector<double> x, y;
  std::vector<std::string> names;  ///< of the points
  bool line = false;               ///< points are joined in the order of x
  bool front = false;              ///< drawn as rings around other series' points
  bool dots = true;                ///< each point is marked
};
struct ReportPlot {
  std::string title, x_label, y_label;
  bool log_x = true, log_y = true;
  std::vector<ReportSeries> series;  ///< on a logarithmic axis points that are not above 0 are left out
  /// Bars instead: x = 0, 1, ... are these groups, in which the series stand beside each other, or on each other.
  std::vector<std::string> groups = {};
  bool stacked = false;
  bool y_bytes = false;  ///< y is shown with binary units
  bool half = false;     ///< half as wide as the page: two stand beside each other
};

/// How much there is of something in each treelet or cell of neighbours, as squares in the order of the file.
struct ReportHeatMap {
  std::string title, unit;
  uint64_t items_count = 0, items_a_cell = 1;
  std::vector<uint64_t> cells;
  uint64_t scale_end = 0;  ///< what has the last colour: so that maps can be compared
};
struct ReportHeatMaps {
  std::vector<ReportHeatMap> maps;
  std::string caption;
};

/// Pictures side by side; of one size.
struct ReportPictures {
  struct Item {
    std::string caption;
    std::vector<std::vector<uint8_t>> rgb;  ///< 8-bit sRGB, of width x height each
  };
  uint32_t width = 0, height = 0;
  std::vector<Item> items;
};

struct ReportSection {
  std::string heading;
  std::vector<std::variant<ReportHeading, ReportText, ReportList, ReportTable, ReportPlot, ReportPictures,
                           ReportHeatMaps>>
      blocks;
};

struct ReportPage {
  std::string title, subtitle;
  std::vector<ReportSection> sections;
  std::string data_json;  ///< embedded as <script id="data">
};

/// Fails with: kInternal (a picture cannot be packed).
Result<std::string> report_html(const ReportPage& page);

/// Whether plots can be drawn: the library was there when the program was built.
bool report_has_plots();

}  // namespace shoal
