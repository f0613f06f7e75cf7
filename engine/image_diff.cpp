#include "engine/image_diff.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "engine/flip.h"
#include "io/gltf_json.h"

namespace shoal {
namespace {

// Keeps dark pixels from ruling the relative error (Rousselle, Knaus, Zwicker 2011, "Adaptive Sampling and
// Reconstruction using Greedy Error Minimization").
constexpr double kRelativeMseBias = 0.01;

struct Sums {
  uint64_t values_count = 0;
  double difference = 0, squared = 0, relative_squared = 0;

  void add(double a, double b) {
    const double d = a - b;
    ++values_count;
    difference += d;
    squared += d * d;
    relative_squared += d * d / (b * b + kRelativeMseBias);
  }
  void finish(ChannelDiff& channel) const {
    if (values_count == 0) return;
    const double n = static_cast<double>(values_count);
    channel.mean = difference / n;
    channel.rmse = std::sqrt(squared / n);
    channel.relative_mse = relative_squared / n;
  }
};

bool same_bits(float a, float b) { return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b); }

/// Integers are compared as such: as floats they are rounded above 2^24.
bool same_bits(const ExrChannel& a, const ExrChannel& b, size_t pixel) {
  if (!a.integers.empty() && !b.integers.empty()) return a.integers[pixel] == b.integers[pixel];
  return same_bits(a.values[pixel], b.values[pixel]);
}

void accumulate(bool same, float a, float b, ChannelDiff& channel, Sums& sums) {
  if (!same) ++channel.differing_count;
  if (!std::isfinite(a) || !std::isfinite(b)) {
    ++channel.non_finite_count;
    return;
  }
  const double difference = std::abs(static_cast<double>(a) - b);
  channel.max_absolute = std::max(channel.max_absolute, difference);
  const double larger = std::max(std::abs(static_cast<double>(a)), std::abs(static_cast<double>(b)));
  if (difference > 0) channel.max_relative = std::max(channel.max_relative, difference / larger);
  sums.add(a, b);
}

bool is_cost_map(const std::string& name) {
  return std::any_of(std::begin(kCostChannelPrefixes), std::end(kCostChannelPrefixes),
                     [&](const char* prefix) { return name.starts_with(prefix); });
}

using ChannelMap = std::map<std::string, const ExrChannel*>;

ChannelMap compared_channels(const ExrImage& image, const ImageDiffOptions& options) {
  ChannelMap channels;
  for (const ExrChannel& channel : image.channels) {
    if (options.cost_maps || !is_cost_map(channel.name)) channels[channel.name] = &channel;
  }
  return channels;
}

/// Notes channels that only one picture has and drops them; true when there are none.
bool keep_common(ChannelMap& from, const ChannelMap& other, const char* which, ImageDiff& diff) {
  bool same = true;
  for (auto it = from.begin(); it != from.end();) {
    if (other.count(it->first) != 0) {
      ++it;
      continue;
    }
    diff.notes.push_back(fmt::format("channel {} is in the {} picture only", gltf::printable(it->first), which));
    it = from.erase(it);
    same = false;
  }
  return same;
}

bool check_windows(const ExrImage& a, const ExrImage& b, ImageDiff& diff) {
  if (a.width == b.width && a.height == b.height && a.data_x == b.data_x && a.data_y == b.data_y) return true;
  diff.notes.push_back(fmt::format("data windows differ: {}x{} at ({}, {}) and {}x{} at ({}, {})", a.width,
                                   a.height, a.data_x, a.data_y, b.width, b.height, b.data_x, b.data_y));
  return false;
}

void find_first(const ChannelMap& a, const ChannelMap& b, uint32_t width, size_t pixel, ImageDiff& diff) {
  for (const auto& [name, channel] : a) {
    if (same_bits(*channel, *b.at(name), pixel)) continue;
    diff.first = {true, static_cast<uint32_t>(pixel % width), static_cast<uint32_t>(pixel / width), name,
                  channel->values[pixel], b.at(name)->values[pixel]};
    return;
  }
}

/// Differing pixels over all channels; the first of them is described.
void count_pixels(const ChannelMap& a, const ChannelMap& b, uint32_t width, ImageDiff& diff) {
  for (size_t pixel = 0; pixel < diff.pixels_count; ++pixel) {
    const bool differs = std::any_of(a.begin(), a.end(), [&](const auto& entry) {
      return !same_bits(*entry.second, *b.at(entry.first), pixel);
    });
    if (!differs) continue;
    if (diff.differing_pixels_count++ == 0) find_first(a, b, width, pixel, diff);
  }
}

void compare_channels(const ChannelMap& a, const ChannelMap& b, ImageDiff& diff) {
  Sums color_sums;
  diff.color.name = "RGB";
  for (const auto& [name, channel] : a) {
    const std::vector<float>& reference = b.at(name)->values;
    ChannelDiff result;
    result.name = name;
    Sums sums;
    const bool is_color = name == "R" || name == "G" || name == "B";
    for (size_t i = 0; i < channel->values.size(); ++i) {
      const bool same = same_bits(*channel, *b.at(name), i);
      accumulate(same, channel->values[i], reference[i], result, sums);
      if (is_color) accumulate(same, channel->values[i], reference[i], diff.color, color_sums);
    }
    sums.finish(result);
    diff.channels.push_back(result);
  }
  color_sums.finish(diff.color);
}

/// R, G and B as one picture; nothing where one is missing.
std::optional<std::vector<float>> rgb_of(const ChannelMap& channels) {
  std::vector<float> rgb;
  for (size_t c = 0; c < 3; ++c) {
    const auto at = channels.find(std::string(1, "RGB"[c]));
    if (at == channels.end()) return std::nullopt;
    const std::vector<float>& values = at->second->values;
    rgb.resize(values.size() * 3);
    for (size_t i = 0; i < values.size(); ++i) rgb[i * 3 + c] = values[i];
  }
  return rgb;
}

nlohmann::ordered_json channel_json(const ChannelDiff& channel) {
  return {{"name", channel.name},
          {"differing_count", channel.differing_count},
          {"non_finite_count", channel.non_finite_count},
          {"max_absolute", channel.max_absolute},
          {"max_relative", channel.max_relative},
          {"mean", channel.mean},
          {"rmse", channel.rmse},
          {"relative_mse", channel.relative_mse}};
}

std::string channel_text(const ChannelDiff& channel) {
  return fmt::format(
      "{:<16} max abs {:.3e}  max rel {:.3e}  mean {:+.3e}  rmse {:.3e}  relMSE {:.3e}  differing {}{}",
      gltf::printable(channel.name), channel.max_absolute, channel.max_relative, channel.mean, channel.rmse, channel.relative_mse,
      channel.differing_count,
      channel.non_finite_count ? fmt::format("  not finite {}", channel.non_finite_count) : std::string());
}

}  // namespace

ImageDiff diff_images(const ExrImage& a, const ExrImage& b, const ImageDiffOptions& options) {
  ImageDiff diff;
  ChannelMap channels_a = compared_channels(a, options), channels_b = compared_channels(b, options);
  const ChannelMap all_a = channels_a;
  bool same_channels = keep_common(channels_a, channels_b, "first", diff);
  same_channels &= keep_common(channels_b, all_a, "second", diff);
  diff.comparable = check_windows(a, b, diff);
  if (!diff.comparable) return diff;

  diff.pixels_count = static_cast<uint64_t>(a.width) * a.height;
  for (const auto* channels : {&channels_a, &channels_b}) {
    for (const auto& [name, channel] : *channels) SHOAL_CHECK(channel->values.size() == diff.pixels_count);
  }
  compare_channels(channels_a, channels_b, diff);
  count_pixels(channels_a, channels_b, a.width, diff);
  diff.identical = same_channels && diff.differing_pixels_count == 0;
  if (!options.flip || diff.pixels_count == 0) return diff;
  const auto test = rgb_of(channels_a), reference = rgb_of(channels_b);
  if (test && reference) diff.mean_flip = mean_value(hdr_flip(a.width, a.height, *reference, *test));
  return diff;
}

std::string diff_text(const ImageDiff& diff) {
  const std::string flip = diff.mean_flip ? fmt::format("\n  HDR-FLIP, mean: {:.5f}", *diff.mean_flip) : "";
  if (diff.identical) {
    return fmt::format("identical: {} pixels, {} channels, every bit equal{}", diff.pixels_count, diff.channels.size(),
                       flip);
  }
  std::string text = "different";
  for (const std::string& note : diff.notes) text += "\n  " + note;
  if (!diff.comparable) return text;
  text += fmt::format("\n  {} of {} pixels differ", diff.differing_pixels_count, diff.pixels_count);
  if (diff.first.found) {
    text += fmt::format("; the first at ({}, {}), channel {}: {} and {}", diff.first.x, diff.first.y,
                        gltf::printable(diff.first.channel), diff.first.a, diff.first.b);
  }
  if (std::any_of(diff.channels.begin(), diff.channels.end(), [](const auto& c) { return c.name == "R"; })) {
    text += "\n  " + channel_text(diff.color);
  }
  for (const ChannelDiff& channel : diff.channels) text += "\n  " + channel_text(channel);
  return text + flip;
}

std::string diff_json(const ImageDiff& diff) {
  nlohmann::ordered_json json = {{"schema", 1},
                                 {"identical", diff.identical},
                                 {"comparable", diff.comparable},
                                 {"notes", diff.notes},
                                 {"pixels_count", diff.pixels_count},
                                 {"differing_pixels_count", diff.differing_pixels_count}};
  if (diff.first.found) {
    // Values that are not finite have no JSON number; nlohmann writes null for them.
    json["first"] = {{"x", diff.first.x},
                     {"y", diff.first.y},
                     {"channel", diff.first.channel},
                     {"a", diff.first.a},
                     {"b", diff.first.b}};
  }
  if (diff.mean_flip) json["mean_hdr_flip"] = *diff.mean_flip;
  json["color"] = channel_json(diff.color);
  json["channels"] = nlohmann::ordered_json::array();
  for (const ChannelDiff& channel : diff.channels) json["channels"].push_back(channel_json(channel));
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace shoal
