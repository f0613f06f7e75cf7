// Runs the program under test as its users do: a process of its own, with its output and exit code. Used by
// tests/bins. Every run has a deadline, so that a hang is a failure and not a stuck test. HOME and the cache folder
// are the temporary folder's, so that no test reads or leaves anything outside it.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace shoal::testing {

struct ProgramRun {
  int exit_code = -1;  ///< -1: it did not exit by itself
  int signal = 0;      ///< that ended it, when one did
  bool timed_out = false;
  std::string out, err;
};

/// A running program; the destructor kills and reaps what still runs.
class Program {
 public:
  /// Starts `command` (the first word is the file). Its output goes to hidden files of `folder`.
  Program(const TemporaryFolder& folder, const std::vector<std::string>& command);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void send(int signal) const;
  /// What it has written to stderr by now.
  std::string err() const;
  bool running();
  /// Waits for the end, kills it after `deadline`.
  ProgramRun wait(std::chrono::seconds deadline = std::chrono::seconds(120));

 private:
  std::string out_path_, err_path_;
  pid_t pid_ = -1;
  int status_ = 0;
};

/// `shoal` with these arguments, from start to end.
ProgramRun run_shoal(const TemporaryFolder& folder, const std::vector<std::string>& arguments);
/// A shell command in which $SHOAL is the program, in the temporary folder: for limits that only a shell sets.
ProgramRun run_shell(const TemporaryFolder& folder, const std::string& command);

std::string file_text(const std::string& path);
void put_file(const std::string& path, const std::string& text);

}  // namespace shoal::testing
