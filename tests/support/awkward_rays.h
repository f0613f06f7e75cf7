// Rays that traversal could get wrong, for tests that compare with brute force. Header only.
#pragma once

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {

/// Rays of every awkward sort at a scene about [-1, 1]^3 in size.
inline std::vector<Ray> awkward_rays(std::mt19937& random, const std::vector<TestTriangle>& triangles,
                                     size_t count) {
  std::vector<Ray> rays;
  std::uniform_real_distribution<float> uniform(0, 1);
  while (rays.size() < count) {
    const TestTriangle& aim = triangles[random() % triangles.size()];
    Vec3 origin = random_vector(random, 2), direction = random_vector(random);
    switch (rays.size() % 10) {
      case 0:
        break;
      case 1:  // along an axis
        direction = Vec3(0), direction[static_cast<int>(random() % 3)] = random() % 2 ? 1.0f : -1.0f;
        origin = aim.p[0] - direction * 3.0f;
        break;
      case 2:  // at a vertex
        direction = aim.p[random() % 3] - origin;
        break;
      case 3:  // at an edge
        direction = aim.p[0] + (aim.p[1] - aim.p[0]) * uniform(random) - origin;
        break;
      case 4:  // in the plane of a triangle
        origin = aim.p[0] + (aim.p[1] - aim.p[0]) * 3.0f;
        direction = aim.p[2] + (aim.p[1] - aim.p[2]) * uniform(random) - origin;
        break;
      case 5:  // from far away
        origin = direction * 1e4f;
        direction = aim.p[0] * uniform(random) - origin;
        break;
      case 6:  // one component zero
        direction = aim.p[0] - origin, direction[static_cast<int>(random() % 3)] = random() % 2 ? 0.0f : -0.0f;
        break;
      case 7:  // huge
        direction *= 1e30f;
        break;
      case 8:  // denormal components
        direction = aim.p[0] - origin, direction[static_cast<int>(random() % 3)] = 1e-41f;
        break;
      case 9:  // from a vertex
        origin = aim.p[0];
        break;
    }
    rays.push_back(make_ray(origin, direction, kRayInfinity, random() % 4 == 0));
    rays.back().alpha_seed = static_cast<uint32_t>(random());
  }
  return rays;
}

}  // namespace shoal::testing
