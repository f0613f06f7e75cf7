// The checks of a .shoal file's tables and pages against each other: after check_tables() no reader can index
// outside anything, whatever bytes the file holds. Called by engine/open_scene. Cost: one pass over the tables.
#pragma once

#include "engine/scene.h"

namespace shoal {

/// Everything but the top tree (TopTree::check). Requires: scene.file open.
/// Fails with: kCorrupt (names the table and the index).
Status check_tables(const Scene& scene);

}  // namespace shoal
