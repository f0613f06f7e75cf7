#include "engine/emitters.h"

#include <fmt/format.h>

#include <cmath>

namespace shoal {

bool has_area(const float* p) {
  double e[2][3];
  for (int c = 0; c < 3; ++c) {
    e[0][c] = double{p[3 + c]} - p[c];
    e[1][c] = double{p[6 + c]} - p[c];
  }
  for (int c = 0; c < 3; ++c) {
    const int d = (c + 1) % 3;
    const double normal = e[0][c] * e[1][d] - e[0][d] * e[1][c];
    if (!std::isfinite(normal)) return false;
    if (normal != 0) return true;
  }
  return false;
}

std::vector<Emitter> collect_emitters(const TriangleSoup& soup, std::span<const Material> materials) {
  std::vector<Emitter> emitters;
  for (size_t i = 0; i < soup.size(); ++i) {
    const Material& material = materials[soup.material[i]];
    if ((material.flags & kMaterialEmits) == 0) continue;
    Emitter e = {};
    std::copy_n(&soup.positions[9 * i], 9, e.position);
    const uint32_t set = material.emissive_texture.uv_set;
    if (material.emissive_texture.texture != kNoIndex && set < soup.layout.uv_count) {
      for (uint32_t k = 0; k < 3; ++k) {
        std::copy_n(&soup.corners[(3 * i + k) * soup.layout.floats() + soup.layout.uv_offset(set)], 2,
                    &e.uv[2 * k]);
      }
    }
    e.material = soup.material[i];
    e.primitive = soup.primitive[i];
    emitters.push_back(e);
  }
  return emitters;
}

Status append_emitters(std::span<const Emitter> of_object, const Instance& instance, uint32_t instance_index,
                       std::vector<Emitter>& out) {
  if (out.size() + of_object.size() > kMaxEmitters) {
    return Error{ErrorCode::kInput,
                 fmt::format("emissive triangles: expected at most {}, found more", kMaxEmitters)};
  }
  for (Emitter e : of_object) {
    for (int k = 0; k < 3 && !instance.identity; ++k) {
      const Vec3 p =
          instance.object_to_world.point({e.position[3 * k], e.position[3 * k + 1], e.position[3 * k + 2]});
      e.position[3 * k] = p.x, e.position[3 * k + 1] = p.y, e.position[3 * k + 2] = p.z;
    }
    e.instance = instance_index;
    if (has_area(e.position)) out.push_back(e);
  }
  return {};
}

}  // namespace shoal
