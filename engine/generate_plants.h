// Plants as small meshes in memory, each of about the number of triangles asked for: for instanced forests. Called
// by engine/generate_*. Plain functions; metres, standing on the origin, y up.
#pragma once

#include <cstdint>
#include <string>

#include "engine/scene_composer.h"

namespace shoal {

/// A plant: what is wood (normals, no colour) and what is leaf (flat, vertex colours or uv of a card). Either may
/// be empty.
struct Plant {
  MeshData wood, leaves;
  uint64_t triangles_count() const { return wood.triangles_count() + leaves.triangles_count(); }
};

Plant broadleaf_tree(uint64_t triangles, uint32_t seed);
Plant conifer_tree(uint64_t triangles, uint32_t seed);
/// Cards with uv for a texture of leaves, crossing at random.
Plant card_bush(uint64_t triangles, uint32_t seed);
/// Arched strips with uv for a texture of a frond.
Plant fern(uint64_t triangles, uint32_t seed);
Plant grass_tuft(uint64_t triangles, uint32_t seed);

}  // namespace shoal
