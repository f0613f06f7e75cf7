// Closed meshes whose edges and corners are hard to hit: fans about corners of many triangles, slivers, triangles of one
// ulp. All are seen whole from about `inside`: a ray that begins within `room` of it must hit something.
#pragma once

#include <string>
#include <vector>

#include "tests/support/test_meshes.h"

namespace shoal::testing {

struct ClosedMesh {
  std::string name;
  std::vector<TestTriangle> triangles;
  Vec3 inside{0};
  float room = 0;
};

inline void number_triangles(std::vector<TestTriangle>& triangles) {
  for (size_t i = 0; i < triangles.size(); ++i) triangles[i].primitive = static_cast<uint32_t>(i);
}

/// Two fans of `count` triangles on one rim: hubs at y = +-1.
inline ClosedMesh two_fans(uint32_t count, float radius) {
  ClosedMesh mesh{"fans of " + std::to_string(count) + (radius < 1 ? ", needle" : ""), {}, Vec3(0), 0.2f * radius};
  const auto rim = [&](uint32_t i) {
    const double angle = 2 * 3.14159265358979 * (i % count) / count;
    return Vec3(radius * std::cos(angle), 0.1 * radius * std::sin(3 * angle), radius * std::sin(angle));
  };
  for (uint32_t i = 0; i < count; ++i) {
    mesh.triangles.push_back({{Vec3(0, 1, 0), rim(i), rim(i + 1)}, 0});
    mesh.triangles.push_back({{Vec3(0, -1, 0), rim(i + 1), rim(i)}, 0});
  }
  number_triangles(mesh.triangles);
  return mesh;
}

/// The faces of a box from `corner`, each cut into side x side squares of two triangles, turned by turns; the sides are
/// `step` long.
inline ClosedMesh cut_box(const std::string& name, uint32_t side, const Vec3& corner, const Vec3& step) {
  const float half = 0.5f * static_cast<float>(side);
  ClosedMesh mesh{name, {}, corner + step * half, 0.2f * half * std::min({step.x, step.y, step.z})};
  const auto at = [&](uint32_t axis, uint32_t depth, uint32_t i, uint32_t j) {
    uint32_t cell[3];
    cell[axis] = depth, cell[(axis + 1) % 3] = i, cell[(axis + 2) % 3] = j;
    return corner + step * Vec3(cell[0], cell[1], cell[2]);
  };
  for (uint32_t face = 0; face < 6; ++face) {
    const uint32_t axis = face / 2, depth = face % 2 * side;
    for (uint32_t i = 0; i < side; ++i) {
      for (uint32_t j = 0; j < side; ++j) {
        Vec3 a = at(axis, depth, i, j), b = at(axis, depth, i + 1, j), c = at(axis, depth, i + 1, j + 1),
             d = at(axis, depth, i, j + 1);
        if (face % 2 == 0) std::swap(b, d);
        const bool turned = (i + j) % 2 != 0;
        mesh.triangles.push_back({{a, b, turned ? d : c}, 0});
        mesh.triangles.push_back({{turned ? b : a, c, d}, 0});
      }
    }
  }
  number_triangles(mesh.triangles);
  return mesh;
}

inline std::vector<ClosedMesh> closed_meshes() {
  std::vector<ClosedMesh> meshes;
  for (const uint32_t count : {3u, 4u, 7u, 64u, 1000u, 10000u}) meshes.push_back(two_fans(count, 1));
  meshes.push_back(two_fans(16, 1e-7f));  // slivers of 1 to 1e7
  meshes.push_back(cut_box("plate of 1 to 1e7", 4, Vec3(-1, -1, -1e-7f), Vec3(0.5f, 0.5f, 5e-8f)));
  meshes.push_back(cut_box("triangles of one ulp", 8, Vec3(1), Vec3(0x1p-23f)));
  meshes.push_back(cut_box("box along the axes", 8, Vec3(-1), Vec3(0.25f)));
  meshes.push_back({"bumpy sphere", closed_mesh(40, 80, 0.2f), Vec3(0), 0.3f});
  meshes.push_back({"sphere of slivers", closed_mesh(3, 4000, 0), Vec3(0), 0.1f});
  return meshes;
}

/// Rays that begin inside, half of them at edges, half at corners; of those a third an ulp beside.
inline std::vector<Ray> rays_from_inside(const ClosedMesh& mesh, std::mt19937& random, size_t count) {
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<Ray> rays;
  for (size_t i = 0; i < count; ++i) {
    const TestTriangle& t = mesh.triangles[random() % mesh.triangles.size()];
    const uint32_t k = random() % 3;
    const Vec3 origin = i % 5 == 0 ? mesh.inside : mesh.inside + random_vector(random, mesh.room);
    Vec3 target = i % 2 != 0 ? t.p[k] : t.p[k] + (t.p[(k + 1) % 3] - t.p[k]) * uniform(random);
    if (i % 3 == 0) {
      const int axis = static_cast<int>(random() % 3);
      target[axis] = std::nextafter(target[axis], random() % 2 != 0 ? 1e30f : -1e30f);
    }
    if (target == origin) target = t.p[(k + 1) % 3];
    Ray ray;
    ray.origin = origin, ray.direction = target - origin, ray.t = kRayInfinity;
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace shoal::testing
