// What the program says: log lines with time and memory on stderr, a progress bar or lines, errors with their exit
// code. With --progress json every line of stderr is one JSON object: progress has a "stage", all else a "level".
// Called by bins only: the library below neither prints nor exits.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "io/result.h"

namespace shoal {

enum class LogLevel : uint8_t { kError, kWarning, kInfo };
enum class ProgressMode : uint8_t { kAuto, kBar, kLines, kJson, kNone };

class Console {
 public:
  LogLevel level = LogLevel::kInfo;
  ProgressMode progress = ProgressMode::kAuto;

  void info(std::string_view message) { log(LogLevel::kInfo, "", message); }
  void warning(std::string_view message) { log(LogLevel::kWarning, "warning: ", message); }
  /// Prints the error and returns its exit code.
  int error(const Error& error);

  /// `fraction` of `stage` done; `detail` such as "1.2 Mrays/s, 3 GiB read"; how long it will take still, as far as that
  /// can be told.
  void show_progress(std::string_view stage, double fraction, double seconds, std::string_view detail,
                     std::optional<double> seconds_left);
  /// The same; the remaining time is worked out from what is done.
  void show_progress(std::string_view stage, double fraction, double seconds, std::string_view detail);
  /// Ends the bar's line, if there is one.
  void end_progress();

 private:
  void log(LogLevel line_level, std::string_view prefix, std::string_view message);
  std::mutex mutex_;
  bool bar_open_ = false;
  double last_line_seconds_ = -1e9;
};

/// "about 40 s left", "about 3 min left", "about 2.5 h left".
std::string time_left_text(double seconds);

}  // namespace shoal
