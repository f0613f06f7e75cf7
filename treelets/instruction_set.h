// The instruction set that the kernels run with on this machine, for reports. Called by bins. Plain function.
#pragma once

#include <string>

namespace shoal {

/// As Highway names it: "AVX2", "AVX3_ZEN4", "SSE2", ...
std::string instruction_set();

}  // namespace shoal
