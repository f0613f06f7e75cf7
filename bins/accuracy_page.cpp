#include "bins/accuracy_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/pareto_front.h"
#include "engine/render_report.h"

namespace shoal {
namespace {

using Measure = double AccuracyRow::*;

/// The curve or cloud that a row belongs to: its knob, or the name of a combination.
std::string series_of(const AccuracyRow& row) {
  if (row.base) return kSamplesKnob;
  return row.knob == "together" ? row.value.substr(0, row.value.rfind(',')) : row.knob;
}

void add_point(ReportSeries& series, const AccuracyRow& row, Measure measure) {
  series.x.push_back(row.seconds);
  series.y.push_back(row.*measure);
  series.names.push_back(row.name);
}

ReportPlot error_plot(const AccuracyResult& result, const std::string& title, const std::string& label, Measure measure) {
  ReportPlot plot{title, "seconds of a render", label, true, true, {}};
  std::vector<PricedError> choices;
  for (const AccuracyRow& row : result.rows) {
    const std::string name = series_of(row);
    auto at = std::find_if(plot.series.begin(), plot.series.end(), [&](const ReportSeries& s) { return s.label == name; });
    if (at == plot.series.end()) {
      const bool curve = name == kSamplesKnob || row.knob == "together";
      at = plot.series.insert(plot.series.end(), ReportSeries{name, {}, {}, {}, curve, false});
    }
    add_point(*at, row, measure);
    choices.push_back({row.seconds, row.*measure});
  }
  ReportSeries front{"Pareto front: no other is both faster and closer", {}, {}, {}, true, true};
  const std::vector<bool> on_front = pareto_front(choices);
  for (size_t i = 0; i < on_front.size(); ++i) {
    if (on_front[i]) add_point(front, result.rows[i], measure);
  }
  plot.series.push_back(std::move(front));
  return plot;
}

ReportCell number(double value, const char* format) { return {fmt::format(fmt::runtime(format), value), value}; }

ReportTable row_table(const AccuracyResult& result) {
  ReportTable table;
  table.head = {"setting", "seconds", "build s", "from disk", "bytes a triangle", "relMSE", "FLIP", "variance", "+-",
                "bias^2", "+-", "efficiency", "order"};
  for (const AccuracyRow& row : result.rows) {
    const Estimate &variance = row.error.variance, &bias = row.error.bias_squared;
    table.rows.push_back({{{row.name},
                           number(row.seconds, "{:.3g}"),
                           row.build_seconds ? number(*row.build_seconds, "{:.3g}") : ReportCell{"-"},
                           {format_bytes(row.disk_read_bytes), static_cast<double>(row.disk_read_bytes)},
                           number(row.bytes_a_triangle, "{:.1f}"),
                           number(row.rel_mse, "{:.3e}"),
                           number(row.flip, "{:.4f}"),
                           number(variance.value, "{:.3e}"),
                           {fmt::format("{:.0e}", variance.high - variance.value)},
                           {fmt::format("{:.2e}{}", bias.value, row.error.biased ? "" : " (none)"), bias.value},
                           {fmt::format("{:.0e}", bias.high - bias.value)},
                           number(row.efficiency.value, "{:.4g}"),
                           {row.order}},
                          row.pareto});
  }
  table.caption = "Marked: on the Pareto front of relMSE. +-: half of the interval that holds the true value 95 times in 100. "
                  "(none): no bias beyond the noise. Each row is the mean over the seeds; seconds the median.";
  return table;
}

ReportPictures pictures(const AccuracyResult& result) {
  ReportPictures block;
  for (const AccuracyPicture& picture : result.pictures) {
    block.width = picture.width, block.height = picture.height;
    ReportPictures::Item item{picture.title, {picture.rgb}};
    if (!picture.errors.empty()) {
      item.rgb.push_back(picture.errors);
      item.caption += fmt::format(": FLIP of this piece {:.3f}", picture.flip);
    }
    block.items.push_back(std::move(item));
  }
  return block;
}

ReportSection knob_section(const AccuracyResult& result, const std::vector<AccuracySentence>& sentences) {
  ReportSection section{"What a step costs", {}};
  for (size_t i = 0; i < result.knobs.size(); ++i) {
    const AccuracyKnob& knob = result.knobs[i];
    section.blocks.emplace_back(ReportHeading{fmt::format("{} (base: {})", knob.name, result.base().settings[i])});
    section.blocks.emplace_back(ReportText{knob.sentence});
    ReportList steps;
    for (const AccuracySentence& sentence : sentences) {
      if (sentence.knob == knob.name) steps.items.push_back(sentence.text);
    }
    section.blocks.emplace_back(std::move(steps));
  }
  return section;
}

ReportSection method_section(const AccuracyResult& result) {
  ReportSection section{"How it was measured", {}};
  section.blocks.emplace_back(ReportText{fmt::format(
      "{} x {} pixels, {} seeds a setting, {} samples a pixel at the base, {:.0f} s in all{}. relMSE is the mean of (x - r)^2 / "
      "(r^2 + 0.01) without the worst 0.1 % of the pixels; FLIP is what someone sees who flips between a picture and the "
      "reference, at an exposure of {:.2f} stops. Variance and bias are told apart by the seeds. Efficiency is 1 / (variance x "
      "seconds).",
      result.sizes.width, result.sizes.height, result.seeds, result.sizes.samples, result.total_seconds,
      result.budget_seconds > 0 ? fmt::format(" of a budget of {:.0f} s", result.budget_seconds) : std::string(),
      result.exposure)});
  if (!result.left_out.empty()) {
    section.blocks.emplace_back(ReportText{"Left out:"});
    section.blocks.emplace_back(ReportList{result.left_out});
  }
  return section;
}

}  // namespace

ReportPage accuracy_page(const AccuracyResult& result, const std::string& scene_name, const std::string& json) {
  const std::vector<AccuracySentence> sentences = accuracy_sentences(result);
  ReportPage page{"What accuracy costs: " + scene_name, "shoal accuracy, version " SHOAL_VERSION, {}, json};
  ReportSection summary{"In short", {}};
  for (const AccuracySentence& sentence : sentences) {
    if (sentence.knob == "summary" || sentence.knob == "reference") summary.blocks.emplace_back(ReportText{sentence.text});
  }
  page.sections.push_back(std::move(summary));
  ReportSection plots{"Error against time", {}};
  plots.blocks.emplace_back(error_plot(result, "Relative squared error", "relMSE", &AccuracyRow::rel_mse));
  plots.blocks.emplace_back(error_plot(result, "What is seen of it", "mean FLIP", &AccuracyRow::flip));
  page.sections.push_back(std::move(plots));
  page.sections.push_back(knob_section(result, sentences));
  ReportSection views{"The same piece in each setting", {}};
  views.blocks.emplace_back(ReportText{fmt::format(
      "The piece of the picture, at ({}, {}), in which the base is furthest from the reference; beside each its error map, "
      "from black (alike) over purple and orange to white.", result.crop_x, result.crop_y)});
  views.blocks.emplace_back(pictures(result));
  page.sections.push_back(std::move(views));
  page.sections.push_back({"All settings", {row_table(result)}});
  page.sections.push_back(method_section(result));
  return page;
}

}  // namespace shoal
