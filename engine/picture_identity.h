// What a picture depends on, as text: a line a name, so that two can be compared and what differs can be named. Two
// renders with the same text draw the same samples; how many each draws is not part of it. Called by engine/checkpoint
// and engine/merge_sums. Plain functions. Cost: a hash of the scene's directory and of the environment's file.
#pragma once

#include <string>

#include "engine/render.h"

namespace shoal {

/// Program, scene (the hash of its sources that a .shoal has, and of its directory, which has the checksum of every page),
/// and every option of the picture but its samples. Fails with: kInput (environment), kStorage.
Result<std::string> picture_identity(FileSystem& fs, const Scene& scene, const PictureOptions& picture);

/// How `found` differs from `expected`: "bounces is 3, not 8; seed is 1, not 0". Empty: not at all.
std::string identity_difference(const std::string& expected, const std::string& found);

}  // namespace shoal
