// The inside of api::Scene, which api::Tracer shares; and what both make of the errors below. Not installed.
#pragma once

#include <new>
#include <string>
#include <system_error>

#include "engine/scene.h"
#include "shoal/result.h"
#include "shoal/tracer.h"

namespace shoal::api {

struct Scene::Impl {
  shoal::Scene scene;
};

inline Error public_error(const shoal::Error& error) {
  static_assert(static_cast<int>(shoal::ErrorCode::kInternal) == static_cast<int>(ErrorCode::kInternal) &&
                static_cast<int>(shoal::ErrorCode::kUsage) == static_cast<int>(ErrorCode::kUsage) &&
                static_cast<int>(shoal::ErrorCode::kInput) == static_cast<int>(ErrorCode::kInput) &&
                static_cast<int>(shoal::ErrorCode::kUnsupported) == static_cast<int>(ErrorCode::kUnsupported) &&
                static_cast<int>(shoal::ErrorCode::kMemoryCap) == static_cast<int>(ErrorCode::kMemoryCap) &&
                static_cast<int>(shoal::ErrorCode::kStorage) == static_cast<int>(ErrorCode::kStorage) &&
                static_cast<int>(shoal::ErrorCode::kCorrupt) == static_cast<int>(ErrorCode::kCorrupt) &&
                static_cast<int>(shoal::ErrorCode::kStopped) == static_cast<int>(ErrorCode::kStopped));
  return {static_cast<ErrorCode>(error.code), error.message};
}

/// `work()` returns a Result<T>; memory that runs out is an error as well.
template <class T, class Work>
Result<T> within_memory(const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kMemoryCap, "out of memory: lower max_memory_bytes to what the machine has"};
  } catch (const std::system_error& error) {  // no thread can be had
    return Error{ErrorCode::kMemoryCap, std::string("the system refuses what is needed: ") + error.what()};
  }
}

}  // namespace shoal::api
