// The checks of a .shoal file's tables and pages against each other: after check_tables() no reader can index
// outside anything, whatever bytes the file holds. Called by engine/open_scene. Cost: one pass over the tables.
#pragma once

#include "engine/scene.h"

namespace shoal {

/// The scene header alone, first of all: of another version, rows are of other lengths. Fails with: kCorrupt.
Status check_header(const Scene& scene);
/// Everything but the top tree (TopTree::check). Requires: scene.file open.
/// Fails with: kCorrupt (names the table and the index).
Status check_tables(const Scene& scene);

}  // namespace shoal
