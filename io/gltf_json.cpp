#include "io/gltf_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace shoal::gltf {

using nlohmann::json;

struct JsonState {
  std::string file;
  json root;
  std::optional<Error> error;
  std::vector<std::string> warnings;
};

namespace {

const json& as_json(const void* value) { return *static_cast<const json*>(value); }

std::string describe(const json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return fmt::format("an array of {}", value.size());
  return printable(value.dump(-1, ' ', false, json::error_handler_t::replace));
}

/// Depth and number of values by the brackets and commas outside strings: what the parser would build, counted
/// before it builds anything. On text that is not JSON the count is meaningless, and the parser refuses it.
Status check_size(std::string_view text, const std::string& file, uint64_t max_values) {
  uint64_t depth = 0, values = 1;
  for (size_t i = 0; i < text.size(); ++i) {
    switch (text[i]) {
      case '"':
        for (++i; i < text.size() && text[i] != '"'; ++i) {
          if (text[i] == '\\') ++i;
        }
        break;
      case '[':
      case '{':
        if (++depth > kMaxJsonDepth) {
          return Error{ErrorCode::kInput,
                       fmt::format("{}: byte {}: expected JSON nested at most {} deep", file, i, kMaxJsonDepth)};
        }
        ++values;
        break;
      case ']':
      case '}':
        depth -= depth > 0;
        break;
      case ',':
        ++values;
        break;
      default:
        break;
    }
  }
  if (values > max_values) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected at most {} JSON values, found about {}", file, max_values, values)};
  }
  return {};
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr size_t kMaxBytes = 120;
  std::string result(text.substr(0, kMaxBytes));
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  if (text.size() > kMaxBytes) result += "...";
  return result;
}

JsonNode JsonNode::step(const char* name, uint64_t index, const void* value) const {
  SHOAL_CHECK(depth_ < kMaxSteps);  // the readers' own nesting, not the file's
  JsonNode child = *this;
  child.steps_[child.depth_++] = {name, index};
  child.value_ = value;
  return child;
}

std::string JsonNode::place() const {
  std::string place;
  for (uint32_t i = 0; i < depth_; ++i) {
    if (steps_[i].name == nullptr) {
      place += fmt::format("[{}]", steps_[i].index);
    } else {
      if (!place.empty()) place += '.';
      place += printable(steps_[i].name);
    }
  }
  return place.empty() ? "the document" : place;
}

JsonNode JsonNode::member(const char* name) const {
  const void* found = nullptr;
  if (value_ != nullptr && as_json(value_).is_object()) {
    const auto it = as_json(value_).find(name);
    if (it != as_json(value_).end()) found = &*it;
  }
  return step(name, 0, found);
}

JsonNode JsonNode::object(const char* name) const {
  JsonNode child = member(name);
  if (child.present() && !as_json(child.value_).is_object()) {
    child.fail("an object", describe(as_json(child.value_)));
    child.value_ = nullptr;
  }
  return child;
}

JsonNode JsonNode::array(const char* name, uint64_t max_size) const {
  JsonNode child = member(name);
  if (!child.present()) return child;
  const json& value = as_json(child.value_);
  if (!value.is_array() || value.size() > max_size) {
    child.fail(fmt::format("an array of at most {}", max_size), describe(value));
    child.value_ = nullptr;
  }
  return child;
}

void JsonNode::each_member(const std::function<void(const char*, const JsonNode&)>& visit) const {
  if (value_ == nullptr || !as_json(value_).is_object()) return;
  for (auto it = as_json(value_).begin(); it != as_json(value_).end(); ++it) {
    visit(it.key().c_str(), step(it.key().c_str(), 0, &*it));
  }
}

uint64_t JsonNode::size() const {
  return value_ != nullptr && as_json(value_).is_array() ? as_json(value_).size() : 0;
}

JsonNode JsonNode::operator[](uint64_t i) const { return step(nullptr, i, &as_json(value_)[i]); }

JsonNode JsonNode::object_at(uint64_t i) const {
  JsonNode child = (*this)[i];
  if (!as_json(child.value_).is_object()) {
    child.fail("an object", describe(as_json(child.value_)));
    child.value_ = nullptr;
  }
  return child;
}

uint64_t JsonNode::as_whole(uint64_t max) const {
  const json& value = as_json(value_);
  if (value.is_number_unsigned()) {
    const uint64_t number = value.get<uint64_t>();
    if (number <= max) return number;
  } else if (value.is_number_float()) {  // JSON knows no integers: 3.0 is 3
    const double number = value.get<double>();
    if (number >= 0 && number < static_cast<double>(kMaxWhole) && std::floor(number) == number) {
      const auto whole_number = static_cast<uint64_t>(number);
      if (whole_number <= max) return whole_number;
    }
  }
  fail(max == kMaxWhole ? "a whole number >= 0" : fmt::format("a whole number from 0 to {}", max), describe(value));
  return 0;
}

uint64_t JsonNode::as_index(uint64_t size) const {
  if (size == 0) {
    fail("no index, for there is nothing to name", describe(as_json(value_)));
    return 0;
  }
  return as_whole(std::min<uint64_t>(size, 1ull << 32) - 1);
}

double JsonNode::as_number() const {
  const json& value = as_json(value_);
  const double number = value.is_number() ? value.get<double>() : HUGE_VAL;
  if (!(std::fabs(number) <= static_cast<double>(std::numeric_limits<float>::max()))) {
    fail("a number in the range of float", describe(value));
    return 0;
  }
  return number;
}

std::string JsonNode::as_text() const {
  if (!as_json(value_).is_string()) {
    fail("a string", describe(as_json(value_)));
    return {};
  }
  return as_json(value_).get<std::string>();
}

uint64_t JsonNode::whole(const char* name, uint64_t fallback, uint64_t max) const {
  const JsonNode child = member(name);
  return child.present() ? child.as_whole(max) : fallback;
}

uint64_t JsonNode::required_whole(const char* name, uint64_t max) const {
  const JsonNode child = member(name);
  if (child.present()) return child.as_whole(max);
  child.fail("a whole number", "nothing");
  return 0;
}

std::optional<uint32_t> JsonNode::index(const char* name, uint64_t size) const {
  const JsonNode child = member(name);
  if (!child.present()) return std::nullopt;
  return static_cast<uint32_t>(child.as_index(size));
}

uint32_t JsonNode::required_index(const char* name, uint64_t size) const {
  const JsonNode child = member(name);
  if (child.present()) return static_cast<uint32_t>(child.as_index(size));
  child.fail("an index", "nothing");
  return 0;
}

double JsonNode::number(const char* name, double fallback, double lo, double hi) const {
  const JsonNode child = member(name);
  if (!child.present()) return fallback;
  const double value = child.as_number();
  if (value >= lo && value <= hi) return value;
  child.fail(fmt::format("a number from {} to {}", lo, hi), fmt::format("{}", value));
  return fallback;
}

double JsonNode::clamped(const char* name, double fallback, double lo, double hi) const {
  double value = number(name, fallback);
  clamp_numbers(name, &value, 1, lo, hi);
  return value;
}

bool JsonNode::boolean(const char* name, bool fallback) const {
  const JsonNode child = member(name);
  if (!child.present()) return fallback;
  if (as_json(child.value_).is_boolean()) return as_json(child.value_).get<bool>();
  child.fail("true or false", describe(as_json(child.value_)));
  return fallback;
}

std::string JsonNode::text(const char* name, std::string fallback) const {
  const JsonNode child = member(name);
  return child.present() ? child.as_text() : std::move(fallback);
}

void JsonNode::read_numbers(const char* name, double* values, size_t n) const {
  const JsonNode child = member(name);
  if (!child.present()) return;
  if (child.size() != n) {
    child.fail(fmt::format("an array of {} numbers", n), describe(as_json(child.value_)));
    return;
  }
  for (size_t i = 0; i < n; ++i) values[i] = child[i].as_number();
}

void JsonNode::clamp_numbers(const char* name, double* values, size_t n, double lo, double hi) const {
  for (size_t i = 0; i < n; ++i) {
    const double kept = std::clamp(values[i], lo, hi);
    if (kept != values[i]) warn_at(name, fmt::format("{} is outside {}..{}; {} is used", values[i], lo, hi, kept));
    values[i] = kept;
  }
}

void JsonNode::fail(const std::string& expected, const std::string& found) const {
  if (state_->error) return;
  state_->error = Error{ErrorCode::kInput,
                        fmt::format("{}: {}: expected {}, found {}", state_->file, place(), expected, found)};
}

void JsonNode::fail_at(const char* name, const std::string& expected, const std::string& found) const {
  step(name, 0, nullptr).fail(expected, found);
}

void JsonNode::warn_at(const char* name, const std::string& message) const {
  if (state_->warnings.size() >= JsonText::kMaxWarnings) return;
  state_->warnings.push_back(fmt::format("{}: {}", step(name, 0, nullptr).place(), message));
}

bool JsonNode::failed() const { return state_->error.has_value(); }

Error JsonNode::take_error() const {
  SHOAL_CHECK(failed());
  Error error = std::move(*state_->error);
  state_->error.reset();
  return error;
}

JsonText::JsonText(std::unique_ptr<JsonState> state) : state_(std::move(state)) {}
JsonText::JsonText(JsonText&&) noexcept = default;
JsonText& JsonText::operator=(JsonText&&) noexcept = default;
JsonText::~JsonText() = default;

Result<JsonText> JsonText::parse(std::string_view text, const std::string& file, uint64_t max_values) {
  SHOAL_RETURN_IF_ERROR(check_size(text, file, max_values));
  auto state = std::make_unique<JsonState>();
  state->file = file;
  try {
    state->root = json::parse(text.begin(), text.end());
  } catch (const json::exception& e) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected JSON, found: {}", file, printable(e.what()))};
  }
  if (!state->root.is_object()) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected a JSON object, found {}", file, describe(state->root))};
  }
  return JsonText(std::move(state));
}

JsonNode JsonText::root() const {
  JsonNode node;
  node.state_ = state_.get();
  node.value_ = &state_->root;
  return node;
}

Status JsonText::status() const {
  if (state_->error) return *state_->error;
  return {};
}

std::vector<std::string> JsonText::take_warnings() { return std::move(state_->warnings); }

}  // namespace shoal::gltf
