// Pages on their way from the disk while the tracing threads go on: reads under way, and the threads that verify and
// decode what has come. Used by the page cache only.
//
// Properties and assumptions
//   capacity   PagingOptions::read_depth reads at once, each of one page or two neighbours, with a buffer for their
//              stored bytes.
//   ownership  `out` belongs to the loader from try_start() until `finished` is called for its page, exactly once.
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
  std::string eviction = "least-demand";   ///< io/eviction_policy.h
};

class PageLoader {
 public:
  /// What was asked of the disk for a page: its stored bytes, and whether its neighbour came with the same read.
  struct ReadShare {
    uint64_t bytes = 0;
    uint32_t reads = 0;  ///< 1; 0 for the second page of a read
  };
  using Finished = std::function<void(PageId page, std::byte* out, Status status, ReadShare share)>;

  /// Requires: options.read_depth > 0.
  PageLoader(const PageFile& file, const PagingOptions& options, Finished finished);
  ~PageLoader();

  /// Starts reading `page` into `out` (raw_bytes long) and, with one read, the page after it into `next_out` unless that
  /// is nullptr. False when read_depth reads are under way. Requires, with next_out: the two lie side by side.
  bool try_start(PageId page, std::byte* out, std::byte* next_out = nullptr);
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
