#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/accuracy_report.h"

namespace shoal {
namespace {

/// "1.97", "0.71", "12": three digits.
std::string number(double value) {
  const double size = std::abs(value);
  if (size > 0 && (size < 1e-3 || size >= 1e5)) return fmt::format("{:.2e}", value);
  return fmt::format("{:.3g}", value);
}

std::string seconds(double value) { return number(value) + " s"; }

/// "divided by 1.98", "times 1.3", "the same".
std::string change(double from, double to) {
  if (!(from > 0) || !(to > 0)) return "from " + number(from) + " to " + number(to);
  const double ratio = from / to;
  if (ratio > 0.99 && ratio < 1.01) return "the same (" + number(to) + ")";
  return ratio > 1 ? fmt::format("divided by {} (from {} to {})", number(ratio), number(from), number(to))
                   : fmt::format("times {} (from {} to {})", number(1 / ratio), number(from), number(to));
}

std::string percent(double share) { return number(100 * share) + " %"; }

std::string sample_step(const AccuracyRow& from, const AccuracyRow& to) {
  return fmt::format("{} samples from {} to {} takes {} times the time ({} to {}); relMSE is {}, and FLIP {}.",
                     to.samples == 2 * from.samples ? "Doubling" : "Raising", from.samples, to.samples,
                     number(to.seconds / from.seconds), seconds(from.seconds), seconds(to.seconds),
                     change(from.rel_mse, to.rel_mse), change(from.flip, to.flip));
}

/// Rows of the samples knob, the base among them, by their number.
std::vector<const AccuracyRow*> sample_rows(const AccuracyResult& result) {
  std::vector<const AccuracyRow*> rows;
  for (const AccuracyRow& row : result.rows) {
    if (row.base || row.knob == kSamplesKnob) rows.push_back(&row);
  }
  std::sort(rows.begin(), rows.end(), [](auto* a, auto* b) { return a->samples < b->samples; });
  return rows;
}

std::string bias_words(const AccuracyKnob& knob, const AccuracyRow& row, const AccuracyRow& base) {
  if (!row.error.biased) {
    if (!knob.biases) return "";
    return fmt::format(" A bias could not be told from the noise: it is below {}.",
                       percent(std::sqrt(std::max(row.error.bias_squared.high, 0.0))));
  }
  if (base.error.biased && row.error.bias_squared.low <= base.error.bias_squared.high) {
    return fmt::format(" It is biased about as much as the base ({}).", percent(row.bias()));
  }
  return fmt::format(" It is biased by {} (root mean square): no number of samples takes that away.", percent(row.bias()));
}

std::string value_step(const AccuracyKnob& knob, const std::string& own, const AccuracyRow& row, const AccuracyRow& base) {
  std::string text = fmt::format("{} {} instead of {} takes {} times the time ({} for {}); relMSE is {}, and FLIP {}.",
                                 knob.name, row.value, own, number(row.seconds / base.seconds), seconds(row.seconds), seconds(base.seconds),
                                 change(base.rel_mse, row.rel_mse), change(base.flip, row.flip));
  text += bias_words(knob, row, base);
  if (row.file_bytes != base.file_bytes) {
    text += fmt::format(" The file takes {} bytes a triangle instead of {}.", number(row.bytes_a_triangle),
                        number(base.bytes_a_triangle));
  }
  const double of_base = base.error_in(base.seconds);
  if (of_base > 0) {
    text += fmt::format(" For the same time its error would be {} times that of the base.",
                        number(row.error_in(base.seconds) / of_base));
  }
  return text;
}

void add_steps(const AccuracyResult& result, size_t at, std::vector<AccuracySentence>& sentences) {
  const AccuracyKnob& knob = result.knobs[at];
  if (knob.name == kSamplesKnob) {
    const std::vector<const AccuracyRow*> rows = sample_rows(result);
    for (size_t i = 1; i < rows.size(); ++i) sentences.push_back({knob.name, sample_step(*rows[i - 1], *rows[i])});
    return;
  }
  for (const AccuracyRow& row : result.rows) {
    if (row.knob == knob.name) {
      sentences.push_back({knob.name, value_step(knob, result.base().settings[at], row, result.base())});
    }
  }
}

std::string summary(const AccuracyResult& result) {
  const AccuracyRow& base = result.base();
  const AccuracyRow* closest = &base;
  size_t front = 0;
  for (const AccuracyRow& row : result.rows) {
    front += row.pareto;
    if (row.seconds <= base.seconds && row.rel_mse < closest->rel_mse) closest = &row;
  }
  std::string text = fmt::format("{} settings were rendered {} times each, {} x {} pixels; for {} of them none other is both "
                                 "faster and closer to the reference.",
                                 result.rows.size(), result.seeds, result.sizes.width, result.sizes.height, front);
  text += fmt::format(" The base takes {} and has a relMSE of {} and a FLIP of {}.", seconds(base.seconds),
                      number(base.rel_mse), number(base.flip));
  text += closest == &base ? std::string(" Nothing that was tried is closer in its time.")
                           : fmt::format(" Closest in at most its time: {}, {}, relMSE {}, FLIP {}{}.", closest->name,
                                         seconds(closest->seconds), number(closest->rel_mse), number(closest->flip),
                                         closest->error.biased ? ", biased by " + percent(closest->bias()) : "");
  return text;
}

std::string reference_words(const AccuracyResult& result) {
  std::string text = result.reference_given
                         ? std::string("The reference is the picture that was given.")
                         : fmt::format("The reference has {} samples a pixel and took {}.", result.sizes.reference_samples,
                                       seconds(result.reference_seconds));
  if (!result.reference_noise_known) return text + " Its own noise is not known, and counts as bias.";
  double least = result.base().rel_mse;
  for (const AccuracyRow& row : result.rows) least = std::min(least, row.rel_mse);
  text += fmt::format(" Its own noise is {} (relative variance); bias is told with it taken off, relMSE and FLIP hold it",
                      number(result.reference_noise));
  if (least > 0) text += fmt::format(", which is at most {} of a relMSE", percent(std::min(result.reference_noise / least, 1.0)));
  return text + ".";
}

}  // namespace

std::vector<AccuracySentence> accuracy_sentences(const AccuracyResult& result) {
  std::vector<AccuracySentence> sentences = {{"summary", summary(result)}, {"reference", reference_words(result)}};
  for (size_t i = 0; i < result.knobs.size(); ++i) add_steps(result, i, sentences);
  return sentences;
}

}  // namespace shoal
