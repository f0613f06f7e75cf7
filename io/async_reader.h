// Reads that go on while their thread does something else: submitted by any thread, completed in any order.
// Called by io/page_loader. Two ways: io_uring (one system call a submission, no thread), or threads that call
// read_at, where the kernel refuses io_uring or the file has no descriptor (tests).
//
// Properties and assumptions
//   capacity   at most depth() reads in flight; the caller counts.
//   ownership  `out` belongs to the reader from submit() until the completion is returned by wait().
//   errors     a read that io_uring fails or cuts short is tried once more by read_at, whose answer counts.
//   threads    submit(), wait() and wake() from any number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

struct ReadRequest {
  ReadableFile* file = nullptr;
  uint64_t offset = 0;
  std::span<std::byte> out;
  uint32_t tag = 0;  ///< handed back with the completion; below depth(), one read of a tag at a time
};

struct ReadCompletion {
  uint32_t tag = 0;
  Status status;
};

class AsyncReader {
 public:
  virtual ~AsyncReader() = default;
  /// Requires: fewer than depth() reads in flight.
  virtual void submit(const ReadRequest& request) = 0;
  /// Blocks until a read ends or wake() is called; nothing for a wake().
  virtual std::optional<ReadCompletion> wait() = 0;
  /// Makes one wait() return nothing.
  virtual void wake() = 0;
  virtual unsigned depth() const = 0;
  virtual const char* name() const = 0;
};

/// nullptr where the system refuses io_uring.
std::unique_ptr<AsyncReader> make_uring_reader(unsigned depth);
std::unique_ptr<AsyncReader> make_thread_reader(unsigned depth, unsigned threads);

}  // namespace shoal
