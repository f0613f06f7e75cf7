// Triangles for the benchmarks of building: a glTF's as indexed vertices, or of a terrain generated for the purpose.
// Used by bench/build_rate and bench/build_bvh. One thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/result.h"

namespace shoal::bench {

/// A glTF's triangles as Embree takes them. Meshes that several nodes show count once, untransformed: for a rate of
/// building that is the same work.
struct Triangles {
  std::vector<float> vertices;  ///< padded by one float: Embree reads 16 bytes a vertex
  std::vector<uint32_t> indices;

  uint64_t count() const { return indices.size() / 3; }
};

/// Reads all triangles of all meshes. Fails with: what reading the glTF fails with.
Result<Triangles> read_triangles(const std::string& gltf_path);

/// Nine floats a triangle, as treelets/triangle_soup holds them.
std::vector<float> corner_positions(const Triangles& triangles);

/// Writes a terrain of about `triangles` into `folder`; returns the path of its glTF.
Result<std::string> generate_terrain(const std::string& folder, uint64_t triangles);

}  // namespace shoal::bench
