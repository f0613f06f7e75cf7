// What a record of a render (engine/render_record.h) leaves: JSON for compare.json. Called by bins. Plain
// functions.
#pragma once

#include <string>

#include "engine/render_record.h"

namespace shoal {

/// {"interval_seconds", "has_queues", "columns": [{name, unit, meaning}], "seconds": [...], one list a column}; beside those
/// of the samples "disk_read_bytes_per_second", over at least a sixtieth of the render.
std::string timeline_json(const RenderCourse& course);
/// {"treelets_count", "treelets_a_cell", "columns": [...], one list a column}: the cells in the order of the file.
std::string heat_json(const RenderCourse& course);

}  // namespace shoal
