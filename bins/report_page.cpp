#include "bins/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "bins/report_assets.h"
#include "engine/batch_text.h"
#include "io/base64.h"
#include "io/png_image.h"

namespace shoal {
namespace {

constexpr const char* kNoPlots =
    "This plot needs the library uPlot, which was not at hand when the program was built (npm and a network, then configure "
    "again). Its numbers are in the table.";

/// Longer texts in tables stand on the left, as sentences do, shorter ones on the right, as numbers do.
constexpr size_t kLongestOnTheRight = 16;

bool is_words(const ReportCell& cell) { return !cell.value && cell.text.size() > kLongestOnTheRight; }

/// JSON may hold "</script>" and "<!--" in strings, which would end the element early.
std::string in_script(const std::string& json) {
  std::string out;
  for (const char c : json) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }
  return out;
}

std::string dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// Fills `html` block by block.
struct Writer {
  std::string html;
  Status status = {};

  void operator()(const ReportHeading& block) { html += fmt::format("<h3>{}</h3>\n", html_escape(block.text)); }
  void operator()(const ReportText& block) { html += fmt::format("<p>{}</p>\n", html_escape(block.text)); }

  void operator()(const ReportList& block) {
    html += "<ul>\n";
    for (const std::string& item : block.items) html += fmt::format("<li>{}</li>\n", html_escape(item));
    html += "</ul>\n";
  }

  void operator()(const ReportTable& block) {
    html += "<div class=\"scroll\"><table>\n<thead><tr>";
    for (size_t column = 0; column < block.head.size(); ++column) {
      const bool words = std::any_of(block.rows.begin(), block.rows.end(), [&](const ReportTable::Row& row) {
        return column < row.cells.size() && is_words(row.cells[column]);
      });
      html += fmt::format("<th{}>{}</th>", words && column > 0 ? " class=\"text\"" : "", html_escape(block.head[column]));
    }
    html += "</tr></thead>\n<tbody>\n";
    for (const ReportTable::Row& row : block.rows) {
      html += row.marked ? "<tr class=\"marked\">" : "<tr>";
      for (const ReportCell& cell : row.cells) {
        html += &cell != &row.cells.front() && is_words(cell) ? "<td class=\"text\"" : "<td";
        if (cell.value) html += fmt::format(" data-value=\"{}\"", *cell.value);
        if (!cell.path.empty()) html += fmt::format(" data-path=\"{}\"", html_escape(cell.path));
        html += fmt::format(">{}</td>", html_escape(cell.text));
      }
      html += "</tr>\n";
    }
    html += "</tbody></table></div>\n";
    if (!block.caption.empty()) html += fmt::format("<p class=\"note\">{}</p>\n", html_escape(block.caption));
  }

  void operator()(const ReportPlot& plot) {
    nlohmann::ordered_json spec = {{"x", plot.x_label}, {"y", plot.y_label},     {"logX", plot.log_x},
                                   {"logY", plot.log_y}, {"bytes", plot.y_bytes}, {"stacked", plot.stacked}};
    if (!plot.groups.empty()) spec["groups"] = plot.groups;
    size_t points = 0;
    for (const ReportSeries& series : plot.series) {
      nlohmann::ordered_json one = {{"label", series.label}, {"line", series.line}, {"front", series.front}, {"dots", series.dots},
                                    {"x", nlohmann::json::array()}, {"y", nlohmann::json::array()},
                                    {"names", nlohmann::json::array()}};
      for (size_t i = 0; i < series.x.size(); ++i) {
        if ((plot.log_x && !(series.x[i] > 0)) || (plot.log_y && !(series.y[i] > 0))) continue;
        one["x"].push_back(series.x[i]), one["y"].push_back(series.y[i]), one["names"].push_back(i < series.names.size() ? series.names[i] : series.label);
        ++points;
      }
      if (!one["x"].empty()) spec["series"].push_back(one);
    }
    html += fmt::format("<figure class=\"plot{}\" data-points=\"{}\"><h3>{}</h3>\n<div class=\"place\">{}</div>\n", plot.half ? " half" : "", points,
                        html_escape(plot.title),
                        report_has_plots() ? "" : fmt::format("<p class=\"missing\">{}</p>", kNoPlots));
    html += fmt::format("<script type=\"application/json\">{}</script></figure>\n", in_script(dump(spec)));
  }

  void operator()(const ReportHeatMaps& block) {
    html += "<div class=\"gallery\">\n";
    for (const ReportHeatMap& map : block.maps) {
      const nlohmann::ordered_json spec = {{"unit", map.unit},
                                           {"items", map.items_count},
                                           {"itemsACell", map.items_a_cell},
                                           {"end", map.scale_end},
                                           {"cells", map.cells}};
      html += fmt::format("<figure class=\"heat\" data-cells=\"{}\"><h3>{}</h3>\n<canvas></canvas><div class=\"scale\"></div>\n"
                          "<script type=\"application/json\">{}</script></figure>\n",
                          map.cells.size(), html_escape(map.title), in_script(dump(spec)));
    }
    html += "</div>\n";
    if (!block.caption.empty()) html += fmt::format("<p class=\"note\">{}</p>\n", html_escape(block.caption));
  }

  void operator()(const ReportPictures& block) {
    html += "<div class=\"gallery\">\n";
    for (const ReportPictures::Item& item : block.items) {
      html += "<figure><div class=\"pair\">";
      for (const std::vector<uint8_t>& rgb : item.rgb) {
        const Result<std::vector<std::byte>> png = encode_png(block.width, block.height, rgb);
        if (!png.ok()) {
          if (status.ok()) status = png.error();
          continue;
        }
        html += fmt::format("<img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\">", block.width,
                            block.height, html_escape(item.caption), encode_base64(png.value()));
      }
      html += fmt::format("</div><figcaption>{}</figcaption></figure>\n", html_escape(item.caption));
    }
    html += "</div>\n";
  }
};

constexpr const char* kHead = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
)";

}  // namespace

bool report_has_plots() { return !kPlotScript.empty(); }

Result<std::string> report_html(const ReportPage& page) {
  Writer writer;
  std::string& html = writer.html;
  html += kHead;
  html += fmt::format("<title>{}</title>\n<style>{}\n{}</style>\n</head>\n<body>\n", html_escape(page.title), kPlotStyle,
                      kReportTheme);
  html += "<button class=\"theme\" type=\"button\" hidden></button>\n";
  html += fmt::format("<h1>{}</h1>\n<p class=\"subtitle\">{}</p>\n", html_escape(page.title), html_escape(page.subtitle));
  for (const ReportSection& section : page.sections) {
    html += fmt::format("<section>\n<h2>{}</h2>\n", html_escape(section.heading));
    for (const auto& block : section.blocks) std::visit(writer, block);
    html += "</section>\n";
  }
  SHOAL_RETURN_IF_ERROR(writer.status);
  html += fmt::format("<script type=\"application/json\" id=\"data\">{}</script>\n", in_script(page.data_json));
  if (report_has_plots()) html += fmt::format("<script>/*\n{}*/\n{}</script>\n", kPlotLicense, kPlotScript);
  html += fmt::format("<script>\n{}</script>\n</body>\n</html>\n", kReportScript);
  return std::move(writer.html);
}

}  // namespace shoal
