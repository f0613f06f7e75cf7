// Triangles to trace: random soups and closed meshes. Header only.
#pragma once

#include <random>
#include <vector>

#include "tests/support/hand_made_page.h"

namespace shoal::testing {

inline Vec3 random_vector(std::mt19937& random, float scale = 1) {
  std::uniform_real_distribution<float> uniform(-scale, scale);
  const float x = uniform(random), y = uniform(random), z = uniform(random);
  return {x, y, z};
}

/// `count` triangles about `size` large in [-1, 1]^3.
inline std::vector<TestTriangle> random_soup(std::mt19937& random, size_t count, float size,
                                             uint32_t first_primitive = 0) {
  std::vector<TestTriangle> soup(count);
  for (size_t i = 0; i < count; ++i) {
    const Vec3 centre = random_vector(random);
    for (Vec3& p : soup[i].p) p = centre + random_vector(random, size);
    soup[i].primitive = first_primitive + static_cast<uint32_t>(i);
  }
  return soup;
}

/// A closed, connected mesh: a bumpy sphere of 2 * rows * columns triangles or so, vertices shared to the bit.
inline std::vector<TestTriangle> closed_mesh(uint32_t rows, uint32_t columns, float bumps,
                                             uint32_t first_primitive = 0) {
  const auto vertex = [&](uint32_t r, uint32_t c) {
    c %= columns;
    if (r == 0 || r == rows) c = 0;
    const double theta = 3.14159265358979 * r / rows, phi = 2 * 3.14159265358979 * c / columns;
    const double radius = 1 + bumps * std::sin(5 * theta) * std::cos(7 * phi);
    return Vec3(radius * std::sin(theta) * std::cos(phi), radius * std::cos(theta),
                radius * std::sin(theta) * std::sin(phi));
  };
  std::vector<TestTriangle> mesh;
  for (uint32_t r = 0; r < rows; ++r) {
    for (uint32_t c = 0; c < columns; ++c) {
      const Vec3 a = vertex(r, c), b = vertex(r, c + 1), d = vertex(r + 1, c), e = vertex(r + 1, c + 1);
      if (r != 0) mesh.push_back({{a, b, d}, 0});
      if (r + 1 != rows) mesh.push_back({{b, e, d}, 0});
    }
  }
  for (size_t i = 0; i < mesh.size(); ++i) mesh[i].primitive = first_primitive + static_cast<uint32_t>(i);
  return mesh;
}

}  // namespace shoal::testing
