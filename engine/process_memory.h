// What the operating system says of memory: limits (physical, engine/cgroup_limit) and this process's resident set.
// Called by engine/memory_plan and the reports. Linux.
#pragma once

#include <cstdint>

namespace shoal {

uint64_t resident_set_bytes();       ///< now
uint64_t peak_resident_set_bytes();  ///< high-water mark of the process
/// The smaller of physical memory and every cgroup limit above this process.
uint64_t memory_limit_bytes();

}  // namespace shoal
