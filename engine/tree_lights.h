// The lights of a scene as the light tree takes them: where each is, which way it faces, how far it reaches round.
// Called by engine/light_sampler. Pure.
#pragma once

#include "engine/build_light_tree.h"
#include "engine/scene_tables.h"

namespace shoal {

/// An emissive triangle, lit on both sides. `strength`: its area times its luminance.
TreeLight tree_light(const Emitter& emitter, double strength, uint32_t index);
/// A point or spot light. `strength`: the luminance of its intensity.
TreeLight tree_light(const PunctualLight& light, double strength, uint32_t index);

}  // namespace shoal
