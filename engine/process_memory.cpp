#include "engine/process_memory.h"

#include <malloc.h>
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

uint64_t default_cap_bytes() { return memory_limit_bytes() / 10 * 7; }

#if defined(__GLIBC__)
void give_back_when_freed() {
  // By default glibc keeps freed memory in up to 8 arenas a core, and raises the size from which memory comes straight
  // from the system (and goes back to it) to 32 MiB once a block of that size was freed; setting a threshold keeps it
  // where it is: at the size that glibc begins with.
  constexpr int kLargeBlockBytes = 128 << 10;
  mallopt(M_MMAP_THRESHOLD, kLargeBlockBytes);
  mallopt(M_TRIM_THRESHOLD, 2 * kLargeBlockBytes);
  mallopt(M_ARENA_MAX, 2);
}
void give_back_freed_memory() { malloc_trim(0); }
#else
void give_back_when_freed() {}
void give_back_freed_memory() {}
#endif

}  // namespace shoal
