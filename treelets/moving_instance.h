// Instances that move while the shutter is open: rows of the instance table behind those of the instances hold where
// one stands at even times (its keys); between two keys each element of the matrix goes straight, so that every point
// does, and the box over the keys holds the object at any time; or it stays as at the first, if the two are so far
// apart that a straight way would crush it. A ray is of one time and meets the instance where it stands then.
// Called by treelets/ray_space and engine/shade. Pure. Cost: an inverse in double; nothing for what stands still.
#pragma once

#include "treelets/top_tree.h"

namespace shoal {

/// Most keys of one instance.
inline constexpr uint32_t kMaxMotionKeys = 513;

/// Whether the instance stays as at this key until the next: its key_count is 1.
inline bool stays(const Instance& key) { return key.key_count != 0; }

/// The instance as it stands at `time`, in [0, 1] of the shutter; it does not move. The inverse is computed in double
/// and rounded once; where there is none the instance stands as at the key before. Requires: instance.moves(), and that
/// it lies in its table.
Instance instance_at(const Instance& instance, float time);

}  // namespace shoal
