// The memory limit of the control groups that this process is in, version 1, version 2 or both mounted (hybrid). The
// smallest limit of the group and of every group above it that can be seen counts. Where the group's own folder is not
// to be seen (inside a container the path in /proc/self/cgroup may be the host's), the files at the root of the mount
// are read: there they are the container's. Called by engine/process_memory; tests give a folder that plays the root
// of the file system. Linux. Cost: a few small files.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace shoal {

inline constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

/// kNoLimit when no group limits this process or nothing can be read. `root` is put before every path.
uint64_t cgroup_limit_bytes(const std::string& root = "");

}  // namespace shoal
