// The shapes of the processor's data caches: as given on the command line, or as the system describes those of this
// machine. Called by bins; read once.
#pragma once

#include <string>
#include <vector>

#include "engine/cache_model.h"

namespace shoal {

struct CacheLevels {
  std::vector<CacheShape> shapes;  ///< the innermost first; lines of 64 bytes
  std::string source;              ///< where they come from, a few words
};

/// "48K:12,2M:16,105M:15": bytes and ways of each level, the innermost first, of one to four levels; binary units.
/// Fails with: kUsage.
Result<std::vector<CacheShape>> parse_cache_levels(const std::string& text);

/// As parse_cache_levels() takes them.
std::string cache_levels_text(const std::vector<CacheShape>& shapes);

/// Data and unified caches of the first processor, by Linux's sysfs; where it does not say (containers, other
/// systems) those of a common server, and `source` says so. `folder`: another one for tests.
CacheLevels machine_cache_levels(const std::string& folder = "/sys/devices/system/cpu/cpu0/cache");

/// "L1", "L2", ... and "last level" for the last of three or more.
std::string cache_level_name(size_t index, size_t count);

}  // namespace shoal
