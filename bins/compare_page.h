// The report page of `shoal compare`: which sections, plots, tables and pictures it has. Every number on it is taken from
// compare.json and says from where (ReportCell::path). Called by bins/compare_report.
#pragma once

#include <string>
#include <vector>

#include "bins/compare_pictures.h"
#include "bins/report_page.h"

namespace shoal {

/// `json`: the text of compare.json, which the page carries. What it does not have is left out.
ReportPage compare_page(const std::string& json, const std::vector<ComparedPicture>& pictures);

/// The sections with plots, of bins/compare_plots.cpp.
ReportSection traffic_section(const std::string& json);
ReportSection time_section(const std::string& json);
ReportSection phase_section(const std::string& json);
ReportSection heat_section(const std::string& json);

}  // namespace shoal
