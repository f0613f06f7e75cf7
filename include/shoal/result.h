// Errors as values. Every function of this library that can fail because the world is wrong returns Result<T>; none
// throws one of its own, prints or ends the program. (The standard library may throw std::bad_alloc.)
// Thread rule: plain values.
#pragma once

#include <string>
#include <utility>
#include <variant>

namespace shoal::api {

/// What went wrong. The numbers are the exit codes of the program `shoal`.
enum class ErrorCode : int {
  kInternal = 1,     ///< a bug of ours, for example counters that do not balance
  kUsage = 2,        ///< arguments that do not fit together
  kInput = 3,        ///< a file that is missing, or is no .shoal
  kUnsupported = 4,  ///< no function of this library yet
  kMemoryCap = 5,    ///< the memory cap cannot work (the message names the smallest that would), or memory ran out
  kStorage = 6,      ///< an I/O error
  kCorrupt = 7,      ///< a .shoal file whose bytes are not what was written
  kStopped = 9,      ///< TraceOptions::stop became true
};

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;  ///< one sentence: file, place, expected, found
};

/// Either a value or an Error. Requires: value() only where ok(), error() only where not.
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
  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

}  // namespace shoal::api
