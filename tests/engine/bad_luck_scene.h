// A small scene with something of every kind of page: many treelets, attributes, a texture in a file of its own.
#pragma once

#include "tests/support/memory_file_system.h"

namespace shoal::testing {

/// Writes scene.gltf, scene.bin and image0.png.
void save_bad_luck_scene(MemoryFileSystem& fs, uint32_t triangles);

}  // namespace shoal::testing
