// JSON as the glTF readers see it: typed getters that check range and kind and name the place of what is wrong
// ("scene.gltf: accessors[3].count: expected a whole number >= 0, found -1"). The first error sticks to the text
// and every getter after it returns its fallback, so that a section is read straight down and asked once, by
// JsonText::status(). Nesting and the number of values are bounded before anything is built. nlohmann-json stays
// inside the .cpp. Thread rule: one text, one thread. Cost: one map look-up a getter; places are spelled only on
// error.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/result.h"

namespace shoal::gltf {

struct JsonState;

/// Whole numbers up to here are exact in every JSON writer (IEEE double).
inline constexpr uint64_t kMaxWhole = 1ull << 53;
/// glTF's own structure is 8 deep at most; `extras` may go further, within reason.
inline constexpr uint32_t kMaxJsonDepth = 64;

/// A value in its place, or the absence of one. Valid as long as its JsonText.
class JsonNode {
 public:
  bool present() const { return value_ != nullptr; }
  /// A member; absent when missing, or when this node is absent. Each fails when the kind is another.
  JsonNode object(const char* name) const;
  JsonNode array(const char* name, uint64_t max_size) const;
  /// The same without a check of the kind.
  JsonNode member(const char* name) const;
  void each_member(const std::function<void(const char* name, const JsonNode& value)>& visit) const;

  /// Of an array: elements; 0 for anything else.
  uint64_t size() const;
  JsonNode operator[](uint64_t i) const;  ///< Requires: i < size()
  /// An element that must be an object.
  JsonNode object_at(uint64_t i) const;

  /// Members of an object. A missing one gives the fallback; one that is wrong fails.
  uint64_t whole(const char* name, uint64_t fallback, uint64_t max = kMaxWhole) const;
  uint64_t required_whole(const char* name, uint64_t max = kMaxWhole) const;
  /// An index into an array of `size` objects.
  std::optional<uint32_t> index(const char* name, uint64_t size) const;
  uint32_t required_index(const char* name, uint64_t size) const;
  /// Numbers beyond the range of float fail; [lo, hi] fails, clamped() warns and clamps.
  double number(const char* name, double fallback, double lo = -kAny, double hi = kAny) const;
  double clamped(const char* name, double fallback, double lo, double hi) const;
  bool boolean(const char* name, bool fallback) const;
  std::string text(const char* name, std::string fallback = {}) const;

  template <size_t N>
  std::array<double, N> numbers(const char* name, std::array<double, N> fallback) const {
    read_numbers(name, fallback.data(), N);
    return fallback;
  }
  template <size_t N>
  std::array<double, N> clamped_numbers(const char* name, std::array<double, N> fallback, double lo,
                                        double hi) const {
    read_numbers(name, fallback.data(), N);
    clamp_numbers(name, fallback.data(), N, lo, hi);
    return fallback;
  }

  /// Of the value itself.
  uint64_t as_index(uint64_t size) const;
  std::string as_text() const;
  double as_number() const;

  /// Records an error at this node or at one of its members, unless there is one.
  void fail(const std::string& expected, const std::string& found) const;
  void fail_at(const char* name, const std::string& expected, const std::string& found) const;
  void warn_at(const char* name, const std::string& message) const;
  bool failed() const;
  /// The error so far, which the text forgets: of a part that can be done without. Requires: failed().
  Error take_error() const;

 private:
  friend class JsonText;
  static constexpr double kAny = std::numeric_limits<double>::max();
  static constexpr uint32_t kMaxSteps = 12;  ///< meshes[3].primitives[1].extensions.KHR_x.mappings[0].variants[2] is 10
  struct Step {
    const char* name;  ///< nullptr: an index
    uint64_t index;
  };

  JsonNode step(const char* name, uint64_t index, const void* value) const;
  std::string place() const;
  uint64_t as_whole(uint64_t max) const;
  void read_numbers(const char* name, double* values, size_t n) const;
  void clamp_numbers(const char* name, double* values, size_t n, double lo, double hi) const;

  JsonState* state_ = nullptr;
  const void* value_ = nullptr;
  std::array<Step, kMaxSteps> steps_{};
  uint32_t depth_ = 0;
};

class JsonText {
 public:
  /// `file` is for messages. Fails with: kInput (not JSON, nested too deep, more than max_values values).
  static Result<JsonText> parse(std::string_view text, const std::string& file, uint64_t max_values);
  JsonText(JsonText&&) noexcept;
  JsonText& operator=(JsonText&&) noexcept;
  ~JsonText();

  JsonNode root() const;  ///< an object
  /// The first error of any getter. Fails with: kInput.
  Status status() const;
  /// Warnings in order; at most kMaxWarnings are kept.
  std::vector<std::string> take_warnings();
  static constexpr size_t kMaxWarnings = 64;

 private:
  explicit JsonText(std::unique_ptr<JsonState> state);
  std::unique_ptr<JsonState> state_;
};

/// Text of a stranger for a message: control characters replaced, cut at 120 bytes.
std::string printable(std::string_view text);

}  // namespace shoal::gltf
