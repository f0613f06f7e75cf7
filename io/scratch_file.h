// A nameless file for what a build cannot hold in memory: made with its whole size, so that a full disk is found out
// before any work, and gone when it is let go or the process ends in any way. Called by engine/build_scene's
// out-of-core part. Thread rule: any number of threads, on ranges that do not overlap. Cost: one system call a call
// (direct I/O: the disk's time, no page cache); an address that is no multiple of kBlockBytes costs a copy.
#pragma once

#include <atomic>

#include "io/aligned_buffer.h"
#include "io/file.h"

namespace shoal {

class ScratchFile {
 public:
  /// `bytes` is rounded up to whole blocks. Fails with: kStorage (folder missing or not writable, disk full: the
  /// message says how many bytes were asked in which folder); nothing is left there.
  static Result<std::unique_ptr<ScratchFile>> create(FileSystem& fs, const std::string& folder, uint64_t bytes);

  uint64_t size_bytes() const { return size_bytes_; }
  /// Requires: offset and size are multiples of kBlockBytes, and inside the file. Fails with: kStorage.
  Status write_at(uint64_t offset, std::span<const std::byte> bytes);
  /// What was never written reads as zero. Requires: inside the file. Fails with: kStorage.
  Status read_at(uint64_t offset, std::span<std::byte> out);
  /// Gives back the space of the whole blocks in the range, where the file system can. Requires: inside the file, and
  /// nobody reads the range any more.
  void release(uint64_t offset, uint64_t bytes);

  /// So far, of all threads.
  uint64_t written_bytes() const { return written_bytes_.load(std::memory_order_relaxed); }
  uint64_t read_bytes() const { return read_bytes_.load(std::memory_order_relaxed); }

 private:
  ScratchFile(std::unique_ptr<NamelessFile> file, uint64_t size_bytes)
      : file_(std::move(file)), size_bytes_(size_bytes) {}
  bool holds(uint64_t offset, uint64_t bytes) const {
    return offset <= size_bytes_ && bytes <= size_bytes_ - offset;
  }

  const std::unique_ptr<NamelessFile> file_;
  const uint64_t size_bytes_;
  std::atomic<uint64_t> written_bytes_{0}, read_bytes_{0};
};

}  // namespace shoal
