// Appends to a file without waiting for the disk: bytes are gathered in one aligned buffer while a thread writes the
// other, so that a direct write (O_DIRECT) moves whole blocks. Called by AtomicFile. Thread rule: one thread calls;
// the writing thread is its own. Cost: one copy of every byte, kWriteBehindBytes of memory, one thread.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>

#include "io/aligned_buffer.h"
#include "io/file.h"

namespace shoal {

inline constexpr uint64_t kWriteBehindBufferBytes = 4u << 20;
/// What a memory plan counts for a file written directly.
inline constexpr uint64_t kWriteBehindBytes = 2 * kWriteBehindBufferBytes;

class WriteBehind {
 public:
  /// Requires: `file` outlives it, and nobody else writes to it. Fails with: kMemoryCap.
  static Result<std::unique_ptr<WriteBehind>> create(WritableFile& file);
  /// Drops what is not written yet.
  ~WriteBehind();

  /// Fails with: kStorage, of this or of an earlier append; from then on every call fails so.
  Status append(std::span<const std::byte> bytes);
  /// Overwrites bytes appended before. Waits for the disk where they have left the buffer. Fails like append().
  /// Requires: offset + bytes.size() <= what was appended.
  Status overwrite(uint64_t offset, std::span<const std::byte> bytes);
  /// Writes what is gathered and waits for it. Later appends are slower where that was no whole number of blocks.
  Status flush();

 private:
  explicit WriteBehind(WritableFile& file) : file_(file) {}
  /// Hands the gathered bytes to the thread, once it is done with those before.
  Status hand_over();
  Status wait_until_idle();
  void write_buffers();

  WritableFile& file_;
  AlignedBuffer memory_[2];
  std::span<std::byte> gathering_;  // the buffer that append() fills
  std::span<std::byte> spare_;      // the other: idle or being written
  uint64_t gathered_bytes_ = 0;
  uint64_t gathering_offset_ = 0;  // of gathering_[0] in the file

  std::mutex mutex_;
  std::condition_variable changed_;
  std::span<const std::byte> pending_;  // of the thread; empty: idle
  uint64_t pending_offset_ = 0;
  std::optional<Error> failure_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace shoal
