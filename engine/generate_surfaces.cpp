#include "engine/generate_surfaces.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace shoal {
namespace {

// 255 x 255 vertices: the largest square that 16-bit indices reach (65535 is primitive restart).
constexpr uint64_t kPatchCells = 254;
constexpr uint32_t kLargestSphereCells = 103;  // 6 * 104^2 = 64896 vertices
constexpr uint64_t kBlockVertices = 32768;     // evaluated at once: 384 KiB
constexpr uint64_t kGrainVertices = 256;

/// Vertex (i, j) of face `face` of a cube with `cells` cells an edge, on the unit sphere. A cube point's
/// coordinates go through the same operations whatever face they come from, so that edges agree.
DVec3 cube_sphere(uint32_t face, uint64_t i, uint64_t j, uint64_t cells) {
  // Near the tangent warp x -> tan(x pi/4): cells of nearly equal area without trigonometry. Maps 1 to 1.
  const auto warp = [](double x) { return x * (0.75 + 0.25 * x * x); };
  const double n = static_cast<double>(cells);
  const double u = warp((2.0 * static_cast<double>(i) - n) / n), v = warp((2.0 * static_cast<double>(j) - n) / n);
  const uint32_t axis = face / 2;
  const bool positive = face % 2 == 0;
  double p[3];
  p[axis] = positive ? 1 : -1;
  p[(axis + (positive ? 1 : 2)) % 3] = u;
  p[(axis + (positive ? 2 : 1)) % 3] = v;
  const double length = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  return DVec3(p[0], p[1], p[2]) / length;
}

}  // namespace

GridSize grid_of(uint64_t cells, double aspect) {
  cells = std::max<uint64_t>(cells, 1);
  const double ideal = std::sqrt(static_cast<double>(cells) * aspect);
  const auto first = std::max<uint64_t>(1, static_cast<uint64_t>(ideal * 0.85));
  const auto last = std::max<uint64_t>(first, static_cast<uint64_t>(ideal * 1.15));
  GridSize best;
  double best_score = -1;
  for (uint64_t columns = first; columns <= last; ++columns) {
    const uint64_t rows = std::max<uint64_t>(1, (cells + columns / 2) / columns);
    const double miss = std::abs(static_cast<double>(columns * rows) - static_cast<double>(cells));
    const double score = 1 / (1 + miss + std::abs(static_cast<double>(columns) - ideal) / ideal);
    if (score > best_score) best_score = score, best = {columns, rows};
  }
  return best;
}

uint32_t sphere_cells(double triangles) {
  return static_cast<uint32_t>(std::max(1.0, std::floor(std::sqrt(triangles / 12) + 0.5)));
}

SurfaceWriter::SurfaceWriter(GltfWriter& writer, std::function<void(uint64_t)> written)
    : writer_(&writer), written_(std::move(written)) {}

uint32_t SurfaceWriter::stream_positions(uint64_t count, const std::function<Vec3(uint64_t)>& position) {
  using Range = oneapi::tbb::blocked_range<uint64_t>;
  std::vector<Vec3> block(std::min(count, kBlockVertices));
  static_assert(sizeof(Vec3) == 3 * sizeof(float));
  writer_->begin_accessor(AccessorKind::kPosition, count);
  for (uint64_t first = 0; first < count; first += kBlockVertices) {
    const uint64_t n = std::min(kBlockVertices, count - first);
    oneapi::tbb::parallel_for(Range(0, n, kGrainVertices), [&](const Range& range) {
      for (uint64_t i = range.begin(); i < range.end(); ++i) block[i] = position(first + i);
    });
    writer_->append_floats({&block[0].x, n * 3});
  }
  return writer_->end_accessor();
}

uint32_t SurfaceWriter::grid_indices(uint32_t faces, GridSize size) {
  const auto key = std::make_pair(faces, std::make_pair(size.columns, size.rows));
  if (const auto found = index_accessors_.find(key); found != index_accessors_.end()) return found->second;
  const uint64_t face_vertices = (size.columns + 1) * (size.rows + 1);
  writer_->begin_accessor(AccessorKind::kIndex16, faces * size.columns * size.rows * 6);
  std::vector<uint32_t> row_indices;
  for (uint32_t face = 0; face < faces; ++face) {
    for (uint64_t row = 0; row < size.rows; ++row) {
      row_indices.clear();
      for (uint64_t column = 0; column < size.columns; ++column) {
        const auto a = static_cast<uint32_t>(face * face_vertices + row * (size.columns + 1) + column);
        const auto c = static_cast<uint32_t>(a + size.columns + 1);
        // The diagonal alternates, so that no direction is preferred.
        if ((row + column) % 2 == 0) {
          row_indices.insert(row_indices.end(), {a, a + 1, c + 1, a, c + 1, c});
        } else {
          row_indices.insert(row_indices.end(), {a, a + 1, c, a + 1, c + 1, c});
        }
      }
      writer_->append_indices(row_indices);
    }
  }
  return index_accessors_[key] = writer_->end_accessor();
}

void SurfaceWriter::add_patch(gltf::Mesh& mesh, uint64_t column, uint64_t row, GridSize size,
                              const GridPosition& position, uint32_t material) {
  gltf::Primitive primitive;
  primitive.attributes["POSITION"] = stream_positions((size.columns + 1) * (size.rows + 1), [&](uint64_t vertex) {
    return position(column + vertex % (size.columns + 1), row + vertex / (size.columns + 1));
  });
  primitive.indices = grid_indices(1, size);
  primitive.material = material;
  mesh.primitives.push_back(primitive);
  triangles_count_ += 2 * size.columns * size.rows;
  if (written_) written_(triangles_count_);
}

void SurfaceWriter::add_grid(gltf::Mesh& mesh, GridSize size, const GridPosition& position, uint32_t material) {
  const uint64_t across = (size.columns + kPatchCells - 1) / kPatchCells;
  const uint64_t along = (size.rows + kPatchCells - 1) / kPatchCells;
  for (uint64_t b = 0; b < along; ++b) {
    const uint64_t row = size.rows * b / along, rows = size.rows * (b + 1) / along - row;
    for (uint64_t a = 0; a < across; ++a) {
      const uint64_t column = size.columns * a / across, columns = size.columns * (a + 1) / across - column;
      if (!writer_->status().ok()) return;
      add_patch(mesh, column, row, {columns, rows}, position, material);
    }
  }
}

void SurfaceWriter::add_sphere(gltf::Mesh& mesh, uint32_t cells, const SpherePosition& position,
                               uint32_t material) {
  if (!writer_->status().ok()) return;
  if (cells > kLargestSphereCells) {
    for (uint32_t face = 0; face < 6; ++face) {
      add_grid(
          mesh, {cells, cells}, [&](uint64_t i, uint64_t j) { return position(cube_sphere(face, i, j, cells)); },
          material);
    }
    return;
  }
  const uint64_t face_vertices = uint64_t{cells + 1} * (cells + 1);
  gltf::Primitive primitive;
  primitive.attributes["POSITION"] = stream_positions(6 * face_vertices, [&](uint64_t vertex) {
    const uint64_t at = vertex % face_vertices;
    return position(
        cube_sphere(static_cast<uint32_t>(vertex / face_vertices), at % (cells + 1), at / (cells + 1), cells));
  });
  primitive.indices = grid_indices(6, {cells, cells});
  primitive.material = material;
  mesh.primitives.push_back(primitive);
  triangles_count_ += sphere_triangles(cells);
  if (written_) written_(triangles_count_);
}

}  // namespace shoal
