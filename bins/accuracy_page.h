// The report page of `shoal accuracy`: which sections, plots, tables and pictures it has. Called by bins/command_accuracy.
#pragma once

#include <string>

#include "bins/report_page.h"
#include "engine/accuracy_report.h"

namespace shoal {

/// `scene_name` for the title; `json`: the document of accuracy_json(), which the page carries.
ReportPage accuracy_page(const AccuracyResult& result, const std::string& scene_name, const std::string& json);

}  // namespace shoal
