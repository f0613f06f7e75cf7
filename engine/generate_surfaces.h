// Displaced grids and spheres of any number of triangles, streamed into a GltfWriter: positions are functions,
// evaluated in parallel block by block and written at once. Only positions are stored (flat shading); patches of
// one size share their index accessor, so that a triangle takes about 6 bytes. Called by engine/generate_*. One
// thread.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <map>
#include <utility>

#include "engine/gltf_writer.h"
#include "treelets/vector.h"

namespace shoal {

using DVec3 = glm::dvec3;

/// A pure function of the vertex; called from many threads at once.
using GridPosition = std::function<Vec3(uint64_t column, uint64_t row)>;
using SpherePosition = std::function<Vec3(const DVec3& unit)>;

/// Columns and rows of cells: columns * rows is as near to `cells` as can be with columns / rows near `aspect`.
struct GridSize {
  uint64_t columns = 1, rows = 1;
};
GridSize grid_of(uint64_t cells, double aspect);

/// Cells an edge of a cube for a sphere of about `triangles`: 12 n^2 triangles, n >= 1.
uint32_t sphere_cells(double triangles);
inline uint64_t sphere_triangles(uint64_t cells) { return 12 * cells * cells; }

class SurfaceWriter {
 public:
  /// `written` is called with the triangles so far after each patch; may be empty.
  explicit SurfaceWriter(GltfWriter& writer, std::function<void(uint64_t)> written = {});

  /// columns x rows cells of two triangles, front up where columns run along +x and rows along -z.
  void add_grid(gltf::Mesh& mesh, GridSize size, const GridPosition& position, uint32_t material);
  /// A cube of 6 x cells x cells cells blown up to the unit sphere, then moved by `position`: 12 cells^2 triangles
  /// without a seam (edges of the cube get the same bits from both sides).
  void add_sphere(gltf::Mesh& mesh, uint32_t cells, const SpherePosition& position, uint32_t material);

  uint64_t triangles_count() const { return triangles_count_; }

 private:
  void add_patch(gltf::Mesh& mesh, uint64_t column, uint64_t row, GridSize size, const GridPosition& position,
                 uint32_t material);
  uint32_t stream_positions(uint64_t count, const std::function<Vec3(uint64_t)>& position);
  uint32_t grid_indices(uint32_t faces, GridSize size);

  GltfWriter* writer_;
  std::function<void(uint64_t)> written_;
  std::map<std::pair<uint32_t, std::pair<uint64_t, uint64_t>>, uint32_t> index_accessors_;
  uint64_t triangles_count_ = 0;
};

}  // namespace shoal
