// Files that report pages are made of, embedded at build time (cmake/shoal_report.cmake). Called by bins/report_page.
#pragma once

#include <string_view>

namespace shoal {

extern const std::string_view kReportTheme;   ///< bins/report/theme.css
extern const std::string_view kReportScript;  ///< bins/report/*.js, one after the other
/// The plotting library, uPlot; empty when it could not be fetched.
extern const std::string_view kPlotStyle, kPlotScript, kPlotLicense;

}  // namespace shoal
