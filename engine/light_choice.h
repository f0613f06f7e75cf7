// By what one of many lights is chosen (docs/lights.md). Taken by engine/shade and engine/light_sampler.
#pragma once

#include <cstdint>

namespace shoal {

enum class LightChoice : uint8_t {
  kTree,     ///< what each may bring to the place, by a tree over them
  kPower,    ///< their power alone
  kUniform,  ///< all alike, an emissive triangle as much as a lamp
};

}  // namespace shoal
