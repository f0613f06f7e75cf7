#include "io/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <limits.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "io/posix_descriptor.h"

namespace shoal {
namespace {

/// Holds the id of the process that a child is to end with.
constexpr const char* kParentVariable = "SHOAL_PARENT";
constexpr uint64_t kCountedBlockBytes = 512;  ///< of ru_inblock and ru_oublock, whatever the disk has

std::vector<std::string> child_environment() {
  const std::string name = std::string(kParentVariable) + "=";
  std::vector<std::string> variables;
  for (char** at = environ; *at != nullptr; ++at) {
    if (std::strncmp(*at, name.c_str(), name.size()) != 0) variables.emplace_back(*at);
  }
  variables.push_back(name + std::to_string(::getpid()));
  return variables;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// What the child is given: no input, `output` for all it says, and the descriptor that is kept.
struct SpawnSetting {
  explicit SpawnSetting(int output, int kept) {
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&actions, output, 1);
    ::posix_spawn_file_actions_adddup2(&actions, output, 2);
    if (kept >= 0) ::posix_spawn_file_actions_adddup2(&actions, kept, kept);  // onto itself: no longer closed by exec
    ::posix_spawnattr_init(&attributes);
    sigset_t mask;
    ::pthread_sigmask(SIG_BLOCK, nullptr, &mask);
    sigdelset(&mask, SIGCHLD);  // ChildWatch is of this process only
    ::posix_spawnattr_setsigmask(&attributes, &mask);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  }
  ~SpawnSetting() {
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
  }
  SpawnSetting(const SpawnSetting&) = delete;
  SpawnSetting& operator=(const SpawnSetting&) = delete;

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
}

}  // namespace

Result<ChildProcess> ChildProcess::start(const ChildCommand& command) {
  SHOAL_CHECK(!command.words.empty());
  const Descriptor output(open_retrying(command.output_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666));
  if (output.get() < 0) {
    return Error{ErrorCode::kStorage, fmt::format("cannot write {}: {}", command.output_path, reason(errno))};
  }
  const SpawnSetting setting(output.get(), command.kept_descriptor);
  std::vector<std::string> words = command.words, variables = child_environment();
  pid_t id = -1;
  const int failed = ::posix_spawn(&id, words[0].c_str(), &setting.actions, &setting.attributes,
                                   pointers_to(words).data(), pointers_to(variables).data());
  if (failed != 0) return Error{ErrorCode::kStorage, fmt::format("cannot start {}: {}", words[0], reason(failed))};
  return ChildProcess(id);
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept : id_(std::exchange(other.id_, -1)) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  std::swap(id_, other.id_);
  return *this;
}

ChildProcess::~ChildProcess() {
  if (id_ < 0) return;
  ::kill(id_, SIGKILL);
  while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void ChildProcess::tell(int signal) const {
  if (id_ >= 0) ::kill(id_, signal);
}

std::optional<ChildEnd> ChildProcess::ended() {
  if (id_ < 0) return std::nullopt;
  int status = 0;
  rusage usage{};
  const pid_t found = ::wait4(id_, &status, WNOHANG, &usage);
  if (found == 0 || (found < 0 && errno == EINTR)) return std::nullopt;
  id_ = -1;
  ChildEnd end;
  if (found < 0) return end;  // somebody else waited for it: how it ended is not known
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  end.user_seconds = seconds_of(usage.ru_utime);
  end.system_seconds = seconds_of(usage.ru_stime);
  end.peak_rss_bytes = static_cast<uint64_t>(usage.ru_maxrss) * 1024;
  end.disk_read_bytes = static_cast<uint64_t>(usage.ru_inblock) * kCountedBlockBytes;
  end.disk_written_bytes = static_cast<uint64_t>(usage.ru_oublock) * kCountedBlockBytes;
  return end;
}

ChildWatch::ChildWatch() {
  // Who starts programs with SIGCHLD ignored has their children reaped unseen.
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  ::sigaction(SIGCHLD, &action, &action_before_);
  sigset_t mask;
  sigemptyset(&mask);
  sigaddset(&mask, SIGCHLD);
  ::pthread_sigmask(SIG_BLOCK, &mask, &mask_before_);
}

ChildWatch::~ChildWatch() {
  ::pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
  ::sigaction(SIGCHLD, &action_before_, nullptr);
}

void ChildWatch::wait(std::chrono::milliseconds longest) const {
  sigset_t mask;
  sigemptyset(&mask);
  sigaddset(&mask, SIGCHLD);
  const timespec time{longest.count() / 1000, longest.count() % 1000 * 1000000};
  ::sigtimedwait(&mask, nullptr, &time);
}

bool end_with_parent() {
  const char* text = std::getenv(kParentVariable);
  if (text == nullptr) return true;
  const long parent = std::strtol(text, nullptr, 10);
  ::unsetenv(kParentVariable);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  return ::getppid() == parent;  // asked last: a parent that went before is found here, one that goes later is heard of
}

std::string own_program() {
  constexpr const char* kSelf = "/proc/self/exe";
  std::array<char, PATH_MAX> path{};
  struct stat self {}, named {};
  const ssize_t bytes = ::readlink(kSelf, path.data(), path.size() - 1);
  const bool same = bytes > 0 && ::stat(kSelf, &self) == 0 && ::stat(path.data(), &named) == 0 &&
                    self.st_dev == named.st_dev && self.st_ino == named.st_ino;
  return same ? path.data() : kSelf;
}

}  // namespace shoal
