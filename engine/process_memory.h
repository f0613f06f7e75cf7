// What the operating system says of memory: limits (physical, engine/cgroup_limit) and this process's resident set; and
// what is given back to it. Called by engine/memory_plan, the builder and the reports. Linux.
#pragma once

#include <cstdint>

namespace shoal {

uint64_t resident_set_bytes();       ///< now
uint64_t peak_resident_set_bytes();  ///< high-water mark of the process
/// The smaller of physical memory and every cgroup limit above this process.
uint64_t memory_limit_bytes();
/// The cap where none is given: 70 % of that.
uint64_t default_cap_bytes();

/// From now on what is freed leaves the process, or the next part of a plan is taken beside it: large blocks at once, of
/// the rest all but little. For the whole process; may be called again.
void give_back_when_freed();
/// Gives back what the allocator keeps of freed memory. Cost: a system call an arena.
void give_back_freed_memory();

}  // namespace shoal
