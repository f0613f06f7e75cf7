// Pages on their way from the disk while the tracing threads go on: reads under way, and the threads that verify and
// decode what has come. Used by the page cache only.
//
// Properties and assumptions
//   capacity   PagingOptions::read_depth pages at once, each with a buffer for its stored bytes.
//   ownership  `out` belongs to the loader from try_start() until `finished` is called for the page, exactly once.
//   threads    try_start() from any thread; `finished` is called from a loader thread, with no lock held.
//   when full  try_start() says no.
//   the end    the destructor waits for what is under way.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "io/page_file.h"
#include "io/result.h"

namespace shoal {

enum class ReadBackend : uint8_t {
  kAuto,     ///< io_uring where the system has it, else threads
  kUring,    ///< the same, named: falls back as well
  kThreads,  ///< threads that call pread
};

/// How pages come from the disk. Changes time and traffic only.
struct PagingOptions {
  unsigned read_depth = 32;      ///< reads under way at most; 0: every page is read by the thread that wants it
  unsigned loader_threads = 1;   ///< threads that verify and decode
  ReadBackend backend = ReadBackend::kAuto;
  std::string eviction = "least-waiting";  ///< io/eviction_policy.h
};

class PageLoader {
 public:
  using Finished = std::function<void(PageId page, std::byte* out, Status status)>;

  /// Requires: options.read_depth > 0.
  PageLoader(const PageFile& file, const PagingOptions& options, Finished finished);
  ~PageLoader();

  /// Starts reading `page` into `out` (raw_bytes long). False when read_depth pages are under way.
  bool try_start(PageId page, std::byte* out);
  bool full() const;
  /// Waits until nothing is under way.
  void finish();
  unsigned under_way() const;
  /// "io_uring" or "threads".
  const char* backend() const;

  /// Memory of the buffers for stored bytes.
  static uint64_t buffer_bytes(const PageFile& file, const PagingOptions& options);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace shoal
