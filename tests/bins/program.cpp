#include "tests/bins/program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include "tests/support/sanitized.h"

extern char** environ;

namespace shoal::testing {
namespace {

using Clock = std::chrono::steady_clock;

/// The environment of this process, with HOME and XDG_CACHE_HOME inside `folder` and $SHOAL the program.
std::vector<std::string> environment_in(const std::string& folder) {
  std::vector<std::string> variables;
  for (char** at = environ; *at != nullptr; ++at) {
    const std::string variable = *at;
    const bool replaced =
        variable.starts_with("HOME=") || variable.starts_with("XDG_CACHE_HOME=") || variable.starts_with("SHOAL=");
    if (!replaced) variables.push_back(variable);
  }
  variables.push_back("HOME=" + folder);
  variables.push_back("XDG_CACHE_HOME=" + folder + "/.cache");
  variables.push_back("SHOAL=" SHOAL_BINARY);
  return variables;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

constexpr int kSlowness = kSanitized ? 20 : 1;

}  // namespace

Program::Program(const TemporaryFolder& folder, const std::vector<std::string>& command) {
  static std::atomic<int> count{0};
  const std::string stem = folder / (".output-" + std::to_string(count++));
  out_path_ = stem + "-out";
  err_path_ = stem + "-err";
  std::vector<std::string> words = command, variables = environment_in(folder.path());
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, 1, out_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::posix_spawn_file_actions_addopen(&actions, 2, err_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int failed = ::posix_spawn(&pid_, words[0].c_str(), &actions, nullptr, pointers_to(words).data(),
                                   pointers_to(variables).data());
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::runtime_error("cannot start " + words[0]);
}

Program::~Program() {
  if (!running()) return;
  send(SIGKILL);
  ::waitpid(pid_, &status_, 0);
}

void Program::send(int signal) const {
  if (pid_ > 0) ::kill(pid_, signal);
}

std::string Program::err() const { return file_text(err_path_); }

bool Program::running() {
  if (pid_ > 0 && ::waitpid(pid_, &status_, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

ProgramRun Program::wait(std::chrono::seconds deadline) {
  ProgramRun run;
  const auto end = Clock::now() + kSlowness * deadline;
  while (running()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    if (Clock::now() < end || run.timed_out) continue;
    run.timed_out = true;
    send(SIGKILL);
  }
  if (WIFEXITED(status_)) run.exit_code = WEXITSTATUS(status_);
  if (WIFSIGNALED(status_)) run.signal = WTERMSIG(status_);
  run.out = file_text(out_path_);
  run.err = file_text(err_path_);
  return run;
}

ProgramRun run_shoal(const TemporaryFolder& folder, const std::vector<std::string>& arguments) {
  std::vector<std::string> command{SHOAL_BINARY};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return Program(folder, command).wait();
}

ProgramRun run_shell(const TemporaryFolder& folder, const std::string& command) {
  return Program(folder, {"/bin/sh", "-c", "cd '" + folder.path() + "' && " + command}).wait();
}

std::string file_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void put_file(const std::string& path, const std::string& text) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace shoal::testing
