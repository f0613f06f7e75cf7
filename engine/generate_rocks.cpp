#include "engine/generate_rocks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/noise.h"

namespace shoal {
namespace {

constexpr int kPlanes = 9;

struct Stone {
  std::array<DVec3, kPlanes> normal;
  std::array<double, kPlanes> distance;
};

Stone cut_stone(uint32_t seed) {
  RandomStream random(seed, 77);
  Stone stone;
  for (int k = 0; k < kPlanes; ++k) {
    stone.normal[k] = DVec3(random.unit_vector());
    stone.distance[k] = random.uniform(0.62f, 0.9f);
  }
  return stone;
}

/// Distance from the centre to the surface: 1, or the nearest cut; corners are rounded by a soft minimum
/// (polynomial, Quilez 2008).
double cut_radius(const Stone& stone, const DVec3& unit) {
  constexpr double kRounding = 0.06;
  double radius = 1;
  for (int k = 0; k < kPlanes; ++k) {
    const double cosine = glm::dot(stone.normal[k], unit);
    if (cosine < 0.3) continue;
    const double cut = stone.distance[k] / cosine;
    const double h = std::max(kRounding - std::abs(radius - cut), 0.0) / kRounding;
    radius = std::min(radius, cut) - h * h * kRounding * 0.25;
  }
  return radius;
}

}  // namespace

SpherePosition rock_surface(const Rock& rock, uint32_t cells) {
  const Stone stone = cut_stone(rock.seed);
  const int octaves = octaves_down_to(1, 1.6 / cells);
  return [rock, stone, octaves](const DVec3& unit) {
    const double noise = ridged_noise(unit.x * 1.7, unit.y * 1.7, unit.z * 1.7, rock.seed, octaves, 0.45);
    const double radius = cut_radius(stone, unit) * (1 + 0.22 * rock.roughness * (noise - 0.5));
    const double height = 0.5 + 0.5 * (rock.taper < 0 ? -unit.y : unit.y);
    const double across = 1 - std::abs(rock.taper) * height;
    return Vec3(rock.center.x + rock.radii.x * radius * across * unit.x,
                rock.center.y + rock.radii.y * radius * unit.y,
                rock.center.z + rock.radii.z * radius * across * unit.z);
  };
}

}  // namespace shoal
