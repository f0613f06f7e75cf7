// What a measurement of accuracy found, as JSON, as CSV, and in plain words. One list of columns (accuracy_report.cpp)
// makes both files. Called by bins/command_accuracy. Plain functions.
#pragma once

#include <string>
#include <vector>

#include "engine/accuracy.h"

namespace shoal {

/// A column of the rows: its name ends with its unit where it has one.
struct AccuracyColumn {
  std::string name, sentence;
};
std::vector<AccuracyColumn> accuracy_columns();

/// accuracy.json, described in docs/accuracy.md.
std::string accuracy_json(const AccuracyResult& result, const Scene& scene, const AccuracyJob& job);
/// The rows: a line each, with every column and every knob's value.
std::string accuracy_csv(const AccuracyResult& result);

struct AccuracySentence {
  std::string knob;   ///< or "summary", or "reference"
  std::string text;   ///< one or more sentences
};
/// What each step of each knob costs on this scene and what it brings, with the numbers of the rows.
std::vector<AccuracySentence> accuracy_sentences(const AccuracyResult& result);

}  // namespace shoal
