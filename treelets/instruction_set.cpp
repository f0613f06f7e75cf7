#include "treelets/instruction_set.h"

#include <hwy/targets.h>

namespace shoal {

std::string instruction_set() {
  // Better sets have lower bits; of those that the kernels are compiled for, the best that the processor has runs.
  const int64_t usable = hwy::SupportedTargets() & HWY_TARGETS;
  return hwy::TargetName(usable & -usable);
}

}  // namespace shoal
