// Programs that this one starts, tells things and waits for: no shell, no search along $PATH, nothing inherited but what
// is named here. Called by engine/batch_run and bins/main. Linux.
// Thread rule: one thread starts, asks and waits, and lives as long as its children: the system ends them with it.
// Cost: posix_spawn, which copies no memory.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/result.h"

namespace shoal {

struct ChildCommand {
  std::vector<std::string> words;  ///< the first is the file of the program
  std::string output_path;         ///< where stdout and stderr go; what is there is replaced
  int kept_descriptor = -1;        ///< open in the child as well; -1: none
};

/// How a child ended and what the system counted until then.
struct ChildEnd {
  int exit_code = -1;  ///< -1: it did not exit by itself
  int signal = 0;      ///< that ended it
  double user_seconds = 0, system_seconds = 0;
  uint64_t peak_rss_bytes = 0;  ///< at least what this process had when it started the child
  uint64_t disk_read_bytes = 0, disk_written_bytes = 0;
};

class ChildProcess {
 public:
  /// Fails with: kStorage (the output cannot be written, the program cannot be started).
  static Result<ChildProcess> start(const ChildCommand& command);
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  /// Kills and waits for what still runs.
  ~ChildProcess();

  pid_t id() const { return id_; }
  void tell(int signal) const;
  /// How it ended, once; nothing while it runs.
  std::optional<ChildEnd> ended();

 private:
  explicit ChildProcess(pid_t id) : id_(id) {}
  pid_t id_ = -1;
};

/// While it lives, wait() learns of children that end.
class ChildWatch {
 public:
  ChildWatch();
  ~ChildWatch();
  ChildWatch(const ChildWatch&) = delete;
  ChildWatch& operator=(const ChildWatch&) = delete;
  /// Until a child ends, a signal is caught, or the time is over.
  void wait(std::chrono::milliseconds longest) const;

 private:
  sigset_t mask_before_;
  struct sigaction action_before_;
};

/// First thing in a program that ChildProcess may have started: from now on SIGTERM comes when its parent is gone, however
/// that ended. False when it is gone already. Does nothing in a program that was started otherwise.
bool end_with_parent();

/// A path that starts this very program, also after another was put in its place.
std::string own_program();

}  // namespace shoal
