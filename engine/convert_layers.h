// The row of layers of a material that has extensions which add lobes: transmission, volume, dispersion, diffuse
// transmission, clearcoat, sheen, anisotropy, iridescence. A material whose extensions change nothing (factor 0, a
// transmissive metal) gets no row. Called by engine/convert_materials. Cost: nothing.
#pragma once

#include "engine/convert_materials.h"
#include "engine/plan_slots.h"

namespace shoal {

/// Sets out.effects and, where it calls for some, out.layers and a new row of plan.layers. Fails with: kInput.
Status plan_layers(SlotPlanner& slots, const gltf::Material& in, MaterialPlan& plan, Material& out);

/// Whether some texture of the row is moved by KHR_texture_transform.
bool has_transform(const MaterialLayers& layers);

}  // namespace shoal
