// Errors as values. Every function below `bins` that can fail because the world is wrong returns
// Result<T> (or Status); a mistake of our own ends in SHOAL_CHECK. Nothing below `bins` prints or exits.
// Thread rule: plain values. Cost: one variant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace shoal {

/// What went wrong. The numeric values are the exit codes of the program (docs/design.md, "Exit codes").
enum class ErrorCode : uint8_t {
  kInternal = 1,     ///< a bug of ours, for example counters that do not balance
  kUsage = 2,        ///< options that do not fit together
  kInput = 3,        ///< input missing, malformed or over a budget
  kUnsupported = 4,  ///< a required glTF extension that we do not read
  kMemoryCap = 5,    ///< the memory cap cannot work, or memory ran out
  kStorage = 6,      ///< disk full or an I/O error
  kCorrupt = 7,      ///< a .shoal file whose bytes are not what was written
  /// Stopped by a signal: no output file is left but preview and checkpoint; a source being --consumed is already destroyed
  /// in part.
  kStopped = 9,
};

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;  ///< one sentence: file, place, expected, found
};

/// Either a value or an Error. Requires: value() only after ok().
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  const Error& error() const& { return std::get<1>(state_); }
  Error&& error() && { return std::get<1>(std::move(state_)); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Error& error() const& { return *error_; }
  Error&& error() && { return *std::move(error_); }

 private:
  std::optional<Error> error_;
};

using Status = Result<void>;

/// Prints the broken condition and aborts. No input byte may reach a failing check.
[[noreturn]] void check_failed(const char* condition, const char* file, int line);

}  // namespace shoal

#define SHOAL_CHECK(condition)                                                   \
  do {                                                                           \
    if (!(condition)) ::shoal::check_failed(#condition, __FILE__, __LINE__);     \
  } while (false)

#define SHOAL_CONCAT_(a, b) a##b
#define SHOAL_CONCAT(a, b) SHOAL_CONCAT_(a, b)

/// SHOAL_RETURN_IF_ERROR(status): returns the error of a Status or Result to the caller.
#define SHOAL_RETURN_IF_ERROR(expression)                                        \
  do {                                                                           \
    auto shoal_status_ = (expression);                                           \
    if (!shoal_status_.ok()) return std::move(shoal_status_).error();            \
  } while (false)

/// SHOAL_ASSIGN_OR_RETURN(auto value, function()): unwraps a Result or returns its error.
#define SHOAL_ASSIGN_OR_RETURN(target, expression)                               \
  SHOAL_ASSIGN_OR_RETURN_(SHOAL_CONCAT(shoal_result_, __LINE__), target, expression)
#define SHOAL_ASSIGN_OR_RETURN_(result, target, expression)                      \
  auto result = (expression);                                                    \
  if (!result.ok()) return std::move(result).error();                            \
  target = std::move(result).value()
