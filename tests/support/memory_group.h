// A memory control group of Linux (version 1 or 2) and programs that run inside it: what the kernel itself says a
// program took, page cache included, and whether it had to be killed. Used by tests/bins and bench. Needs root. One
// thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/result.h"

namespace shoal::testing {

class MemoryGroup {
 public:
  /// A new group below the root of the hierarchy, without swap where that can be said. Fails with: kUnsupported (not
  /// root, no memory controller; the message says which).
  static Result<MemoryGroup> create(uint64_t limit_bytes);
  MemoryGroup(MemoryGroup&&) noexcept = default;
  MemoryGroup& operator=(MemoryGroup&&) = delete;
  ~MemoryGroup();  ///< removes the group, which no process may be in

  uint64_t limit_bytes() const { return limit_bytes_; }
  /// The most that was ever charged to it: memory, page cache and the kernel's own for its processes.
  uint64_t peak_bytes() const;
  /// Processes that the kernel killed because the limit was reached.
  uint64_t oom_kills_count() const;
  /// Write "0" to it to enter.
  std::string entry_file() const { return folder_ + "/cgroup.procs"; }

 private:
  struct Version;
  MemoryGroup(const Version& version, std::string folder, uint64_t limit_bytes);
  static const Version kVersions[2];
  const Version* version_;
  std::string folder_;  ///< empty: moved from
  uint64_t limit_bytes_;
};

/// What became of a program, by the kernel's count.
struct MeasuredRun {
  int exit_code = -1;  ///< -1: it did not exit by itself
  int signal = 0;      ///< that ended it, when one did
  double seconds = 0;
  uint64_t peak_rss_bytes = 0;
  uint64_t disk_read_bytes = 0;  ///< read from block devices for it, read-ahead included
  uint64_t disk_write_bytes = 0;
  uint64_t major_faults_count = 0;
  std::string output;  ///< stdout and stderr
};

/// Runs `command` (the first word is the file) to its end, in `group` from its first instruction (null: in none). It
/// dies with this process.
MeasuredRun run_measured(const std::vector<std::string>& command, const MemoryGroup* group = nullptr);

}  // namespace shoal::testing
