#include "tests/support/memory_group.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <utility>

namespace shoal::testing {

struct MemoryGroup::Version {
  const char* root;
  const char* limit;
  const char* swap_limit;
  const char* swap_value;  ///< null: the limit (version 1 counts memory and swap together)
  const char* peak;
  const char* events;
};

const MemoryGroup::Version MemoryGroup::kVersions[2] = {
    {"/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.memsw.limit_in_bytes", nullptr,
     "memory.max_usage_in_bytes", "memory.oom_control"},
    {"/sys/fs/cgroup", "memory.max", "memory.swap.max", "0", "memory.peak", "memory.events"}};

namespace {

bool put(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text << std::flush;
  return file.good();
}

uint64_t number_in(const std::string& path) {
  std::ifstream file(path);
  uint64_t value = 0;
  file >> value;
  return value;
}

/// In the child, between fork and exec: nothing but system calls.
[[noreturn]] void become(char** words, const char* entry_file, int output) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (entry_file != nullptr) {
    const int entry = ::open(entry_file, O_WRONLY | O_CLOEXEC);
    if (entry < 0 || ::write(entry, "0", 1) != 1) ::_exit(126);
    ::close(entry);
  }
  ::dup2(output, 1);
  ::dup2(output, 2);
  ::execv(words[0], words);
  ::_exit(127);
}

std::string drain(int descriptor) {
  std::string text;
  char block[4096];
  for (ssize_t n; (n = ::read(descriptor, block, sizeof(block))) != 0;) {
    if (n > 0) text.append(block, static_cast<size_t>(n));
    if (n < 0 && errno != EINTR) break;
  }
  return text;
}

}  // namespace

MemoryGroup::MemoryGroup(const Version& version, std::string folder, uint64_t limit_bytes)
    : version_(&version), folder_(std::move(folder)), limit_bytes_(limit_bytes) {}

Result<MemoryGroup> MemoryGroup::create(uint64_t limit_bytes) {
  static std::atomic<uint64_t> count{0};
  std::string why = "no memory controller under /sys/fs/cgroup";
  for (const Version& version : kVersions) {
    if (::access(version.root, F_OK) != 0) continue;
    put(std::string(version.root) + "/cgroup.subtree_control", "+memory");  // version 2; no such file in version 1
    const std::string folder = fmt::format("{}/shoal-{}-{}", version.root, ::getpid(), count++);
    if (::mkdir(folder.c_str(), 0755) != 0) {
      why = fmt::format("{} cannot be made: {}", folder, std::strerror(errno));
      continue;
    }
    MemoryGroup group(version, folder, limit_bytes);
    if (put(folder + "/" + version.limit, std::to_string(limit_bytes)) &&
        ::access((folder + "/" + version.peak).c_str(), R_OK) == 0) {
      put(folder + "/" + version.swap_limit, version.swap_value ? version.swap_value : std::to_string(limit_bytes));
      return group;
    }
    why = fmt::format("{} has no {} or {}", version.root, version.limit, version.peak);
  }
  return Error{ErrorCode::kUnsupported, "memory control groups cannot be made: " + why};
}

MemoryGroup::~MemoryGroup() {
  // A process that has just ended may still be leaving.
  for (int attempt = 0; !folder_.empty() && attempt < 100; ++attempt) {
    if (::rmdir(folder_.c_str()) == 0 || errno != EBUSY) return;
    ::usleep(10000);
  }
}

uint64_t MemoryGroup::peak_bytes() const { return number_in(folder_ + "/" + version_->peak); }

uint64_t MemoryGroup::oom_kills_count() const {
  std::ifstream file(folder_ + "/" + version_->events);
  std::string name;
  for (uint64_t value = 0; file >> name >> value;) {
    if (name == "oom_kill") return value;
  }
  return 0;
}

MeasuredRun run_measured(const std::vector<std::string>& command, const MemoryGroup* group) {
  std::vector<std::string> words = command;
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const std::string entry_file = group != nullptr ? group->entry_file() : "";
  int output[2];
  MeasuredRun run;
  if (::pipe2(output, O_CLOEXEC) != 0) return run;
  const auto start = std::chrono::steady_clock::now();
  const pid_t pid = ::fork();
  if (pid == 0) become(pointers.data(), group != nullptr ? entry_file.c_str() : nullptr, output[1]);
  ::close(output[1]);
  run.output = drain(output[0]);
  ::close(output[0]);
  int status = 0;
  rusage usage{};
  while (pid > 0 && ::wait4(pid, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  if (pid < 0) return run;
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (WIFEXITED(status)) run.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) run.signal = WTERMSIG(status);
  run.peak_rss_bytes = static_cast<uint64_t>(usage.ru_maxrss) * 1024;
  run.disk_read_bytes = static_cast<uint64_t>(usage.ru_inblock) * 512;
  run.disk_write_bytes = static_cast<uint64_t>(usage.ru_oublock) * 512;
  run.major_faults_count = static_cast<uint64_t>(usage.ru_majflt);
  return run;
}

}  // namespace shoal::testing
