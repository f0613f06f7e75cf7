#include "engine/noise_target.h"

#include <fmt/format.h>

#include <charconv>
#include <string_view>

namespace shoal {
namespace {

/// A share: "0.02" or "2%". 0 when it is none.
float parse_share(std::string_view text) {
  const bool percent = text.ends_with('%');
  if (percent) text.remove_suffix(1);
  float value = 0;
  const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || rest != text.data() + text.size() || !(value > 0)) return 0;
  return percent ? value / 100 : value;
}

}  // namespace

Result<NoiseTarget> parse_noise_target(const std::string& text) {
  if (text.empty()) return NoiseTarget{};
  const size_t colon = text.find(':');
  NoiseTarget target;
  target.median = parse_share(std::string_view(text).substr(0, colon));
  target.percentile_95 =
      colon == std::string::npos ? 2 * target.median : parse_share(std::string_view(text).substr(colon + 1));
  if (!(target.median >= 1e-6f) || !(target.median <= 1) || !(target.percentile_95 >= target.median) ||
      !(target.percentile_95 <= 100)) {
    return Error{ErrorCode::kUsage,
                 fmt::format("'{}' is no target for noise: expected the relative standard error at the median pixel, such "
                             "as 0.02 or 2%, or with that at the 95th percentile, 2%:5%, which is no less", text)};
  }
  return target;
}

}  // namespace shoal
