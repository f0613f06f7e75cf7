// What grows and lies on the demo scene's sea floor: corals, weeds, starfish, the open sea around. Called by
// engine/generate_demo. Plain functions; meshes stand on the origin, y up.
#pragma once

#include "engine/generate_surfaces.h"
#include "engine/scene_composer.h"

namespace shoal {

/// Branching coral about 1 high; about `triangles` of them, with normals.
MeshData branch_coral(uint64_t triangles, uint32_t seed);
/// A dome with winding grooves, for SurfaceWriter::add_sphere.
SpherePosition brain_coral(const Vec3& center, const Vec3& radii, uint32_t seed, uint32_t cells);
/// A five-armed star of radius about 1 lying on y = 0, with normals.
MeshData starfish(uint32_t cells);
/// A curved card of width and height 1 with uv, standing on its lower edge.
MeshData curved_card(uint32_t cells, float curve);
/// A bundle of ribbons rising `height` with uv for a texture of leaves.
MeshData kelp(uint32_t ribbons, float height, uint32_t seed);
/// The inside of a dome with a gap towards `gap` (where a direction's cosine to it is above `gap_cosine`); u goes
/// round, 0.5 at -z, v from the zenith to below the horizon.
MeshData sea_dome(float radius, const Vec3& gap, float gap_cosine);

}  // namespace shoal
