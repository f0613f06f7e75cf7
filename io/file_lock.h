// A lock on a file that says who is at work in a folder. It goes with the processes that hold it, however they end: a
// child that was given the descriptor holds it as well. Called by engine/batch_run.
// Thread rule: one owner. Cost: one system call.
#pragma once

#include <atomic>
#include <chrono>
#include <string>

#include "io/result.h"

namespace shoal {

class FileLock {
 public:
  /// Makes the file, locks it and writes the id of this process into it; it stays when the lock is let go. A lock held by
  /// the process named in it is refused at once; one that only children of a process that is gone hold is waited for, at
  /// most `patience`, until `stop`. Fails with: kStorage, kStopped.
  static Result<FileLock> acquire(const std::string& path, std::chrono::milliseconds patience,
                                  const std::atomic<bool>* stop);
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;
  ~FileLock();

  /// To be kept open by children.
  int descriptor() const { return descriptor_; }

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace shoal
