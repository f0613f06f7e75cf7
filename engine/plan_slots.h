// Texture slots of materials while they are converted: UV sets are renumbered, a texture that is wanted in the same way
// twice is stored once, and so is a texture transform. Called by engine/convert_materials and engine/convert_layers.
// Cost: nothing.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "engine/convert_materials.h"

namespace shoal {

/// materials[3] "glass".
std::string material_name(const gltf::Document& document, uint32_t material);

class SlotPlanner {
 public:
  /// Keeps references to both.
  SlotPlanner(const gltf::Document& document, MaterialPlan& plan) : document_(document), plan_(plan) {}

  /// Slots asked for from here on are of this material.
  void begin(uint32_t material) { material_ = material; }
  /// Leaves `out` empty when there is no texture, when it is not wanted, or (with a warning) when its image cannot be
  /// read. Fails with: kInput (see plan_materials).
  Status slot(const std::optional<gltf::TextureInfo>& info, bool wanted, bool srgb, TextureSlot& out);

 private:
  Result<uint16_t> uv_set(uint32_t texcoord);
  Result<uint16_t> transform(const gltf::TextureInfo& info);
  uint32_t request(const gltf::Texture& texture, bool srgb);

  using Key = std::tuple<uint32_t, bool, WrapMode, WrapMode, bool>;
  const gltf::Document& document_;
  MaterialPlan& plan_;
  uint32_t material_ = 0;
  std::map<Key, uint32_t> known_;
  std::map<std::array<float, 6>, uint16_t> transforms_;  // row + 1
};

}  // namespace shoal
