// The materials as they are shaded: the scene's own, or copies without what is forced off (engine/effects.h), so that
// nothing is asked at a vertex. Called by engine/shading_tables. Immutable once made; cost: a copy where something is
// forced off, else nothing.
#pragma once

#include <span>
#include <vector>

#include "engine/effects.h"
#include "engine/scene.h"

namespace shoal {

class ShadedMaterials {
 public:
  /// Keeps references to the scene's where nothing that they hold is forced off.
  ShadedMaterials(const Scene& scene, const EffectChoice& choice);
  ShadedMaterials(const ShadedMaterials&) = delete;
  ShadedMaterials& operator=(const ShadedMaterials&) = delete;

  std::span<const Material> materials() const { return materials_; }
  std::span<const MaterialLayers> layers() const { return layers_; }
  uint64_t resident_bytes() const {
    return changed_.size() * sizeof(Material) + changed_layers_.size() * sizeof(MaterialLayers);
  }

 private:
  std::vector<Material> changed_;
  std::vector<MaterialLayers> changed_layers_;
  std::span<const Material> materials_;
  std::span<const MaterialLayers> layers_;
};

}  // namespace shoal
