#include "engine/process_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "engine/cgroup_limit.h"

namespace shoal {

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
  const uint64_t physical =
      static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  return std::min(physical, cgroup_limit_bytes());
}

}  // namespace shoal
