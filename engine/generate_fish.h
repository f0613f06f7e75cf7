// A fish as a mesh and as textures, for the demo scene. Called by engine/generate_demo. Plain functions.
#pragma once

#include "engine/scene_composer.h"
#include "treelets/vector.h"

namespace shoal {

/// Along z from the tail (-0.5) to the nose (+0.5), y up; `bend` is the phase of its stroke in turns. Body with
/// normals and uv: u from nose to tail, v from back to belly on both sides.
MeshData fish_body(uint32_t rings, uint32_t sides, float bend);
/// Tail, back and belly fins: thin, both sides the same, normals and uv.
MeshData fish_fins(float bend);

/// Base colour: dark back, silver sides, a stripe, an eye.
Vec4 paint_fish(float u, float v);
/// Tangent-space scales.
Vec4 paint_fish_normal(float u, float v);
/// G roughness, B metalness.
Vec4 paint_fish_metal(float u, float v);

}  // namespace shoal
