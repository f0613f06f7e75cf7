#include "engine/process_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace shoal {
namespace {

/// The number in a file such as memory.max; "max" and unreadable files mean no limit.
uint64_t limit_in(const std::string& path) {
  std::ifstream file(path);
  uint64_t value = 0;
  return file >> value ? value : std::numeric_limits<uint64_t>::max();
}

/// The smallest limit of `group` and its parents under `mount`.
uint64_t limit_along(const std::string& mount, std::string group, const std::string& name) {
  uint64_t limit = std::numeric_limits<uint64_t>::max();
  while (true) {
    limit = std::min(limit, limit_in(mount + group + "/" + name));
    const size_t slash = group.rfind('/');
    if (slash == std::string::npos || group.empty()) break;
    group.resize(slash);
  }
  return limit;
}

}  // namespace

uint64_t resident_set_bytes() {
  std::ifstream file("/proc/self/statm");
  uint64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

uint64_t peak_resident_set_bytes() {
  // Not getrusage: its ru_maxrss survives exec and may be the parent's.
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
  }
  return resident_set_bytes();
}

uint64_t memory_limit_bytes() {
  uint64_t limit = static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const size_t first = line.find(':');
    const size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const std::string group = line.substr(second + 1) == "/" ? "" : line.substr(second + 1);
    if (controllers.empty()) {
      limit = std::min(limit, limit_along("/sys/fs/cgroup", group, "memory.max"));
    } else if (controllers.find("memory") != std::string::npos) {
      limit = std::min(limit, limit_along("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
    }
  }
  return limit;
}

}  // namespace shoal
