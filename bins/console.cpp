#include "bins/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "engine/process_memory.h"

namespace shoal {
namespace {

constexpr double kSecondsBetweenLines = 5;

double seconds_since_start() {
  static const auto start = std::chrono::steady_clock::now();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string clock_text(double seconds) {
  const auto whole = static_cast<uint64_t>(seconds);
  return fmt::format("{:02}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

/// Messages name files, whose names may be any bytes: what is not UTF-8 is replaced.
void print_json(const nlohmann::ordered_json& line) {
  fmt::print(stderr, "{}\n", line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

}  // namespace

void Console::log(LogLevel line_level, std::string_view prefix, std::string_view message) {
  if (line_level > level) return;
  std::lock_guard guard(mutex_);
  if (bar_open_) std::fputs("\n", stderr), bar_open_ = false;
  if (progress == ProgressMode::kJson) {
    static constexpr const char* kLevelNames[] = {"error", "warning", "info"};
    print_json({{"level", kLevelNames[static_cast<size_t>(line_level)]},
                {"message", message},
                {"seconds", seconds_since_start()},
                {"rss_bytes", resident_set_bytes()}});
    return;
  }
  fmt::print(stderr, "{} {:>6} MB | {}{}\n", clock_text(seconds_since_start()), resident_set_bytes() >> 20, prefix,
             message);
}

int Console::error(const Error& error) {
  end_progress();
  if (progress == ProgressMode::kJson) {
    print_json({{"level", "error"}, {"message", error.message}, {"exit_code", static_cast<int>(error.code)}});
  } else {
    fmt::print(stderr, "shoal: {}\n", error.message);
  }
  return static_cast<int>(error.code);
}

void Console::show_progress(std::string_view stage, double fraction, double seconds, std::string_view detail) {
  std::optional<double> left;
  if (fraction > 0) left = seconds * (1 - fraction) / fraction;
  show_progress(stage, fraction, seconds, detail, left);
}

void Console::show_progress(std::string_view stage, double fraction, double seconds, std::string_view detail,
                            std::optional<double> seconds_left) {
  ProgressMode mode = progress;
  if (mode == ProgressMode::kAuto) mode = isatty(STDERR_FILENO) != 0 ? ProgressMode::kBar : ProgressMode::kLines;
  if (mode == ProgressMode::kNone) return;
  const std::string left = seconds_left ? time_left_text(*seconds_left) : "";
  std::lock_guard guard(mutex_);
  if (mode == ProgressMode::kBar) {
    const int filled = static_cast<int>(fraction * 30);
    fmt::print(stderr, "\r{:<9}[{:=<{}}{:{}}] {:5.1f} %  {}{}{} MB  {}\x1b[K", stage, "", filled, "", 30 - filled,
               fraction * 100, left, left.empty() ? "" : "  ", resident_set_bytes() >> 20, detail);
    bar_open_ = true;
    std::fflush(stderr);
    return;
  }
  if (seconds - last_line_seconds_ < kSecondsBetweenLines && seconds >= last_line_seconds_) return;
  last_line_seconds_ = seconds;
  if (mode == ProgressMode::kJson) {
    print_json({{"stage", stage},
                {"fraction", fraction},
                {"seconds", seconds},
                {"seconds_left", seconds_left ? nlohmann::ordered_json(*seconds_left) : nlohmann::ordered_json(nullptr)},
                {"rss_bytes", resident_set_bytes()},
                {"detail", detail}});
  } else {
    fmt::print(stderr, "{} {:>6} MB | {} {:.1f} %{}{}{}{}\n", clock_text(seconds_since_start()),
               resident_set_bytes() >> 20, stage, fraction * 100, left.empty() ? "" : ", ", left,
               detail.empty() ? "" : ", ", detail);
  }
}

void Console::end_progress() {
  std::lock_guard guard(mutex_);
  if (bar_open_) std::fputs("\n", stderr);
  bar_open_ = false;
  last_line_seconds_ = -1e9;
}

std::string time_left_text(double seconds) {
  if (seconds < 9.5) return fmt::format("about {:.0f} s left", std::ceil(seconds));
  if (seconds < 95) return fmt::format("about {:.0f} s left", 5 * std::round(seconds / 5));
  if (seconds < 95 * 60) return fmt::format("about {:.0f} min left", seconds / 60);
  const double hours = seconds / 3600;
  return fmt::format("about {:.{}f} h left", hours, hours < 10 ? 1 : 0);
}

}  // namespace shoal
