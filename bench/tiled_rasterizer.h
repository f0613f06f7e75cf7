// A tiled rasteriser for primary visibility, the lecture's third answer: for each triangle which samples, instead
// of for each ray which triangles. A triangle is put into the bins of the tiles that it may touch; a tile goes
// through its bin from front to back, finds the samples in each triangle by edge functions (Pineda 1988) in
// homogeneous coordinates (Olano and Greer 1997, so that nothing need be clipped), and ends when all that is left
// lies behind what it has.
//
// Samples are exactly the camera's rays. Edge functions only propose: they are as wide as the arithmetic needs
// (pad() of bench/visible_triangles.h, moved corners), and what they propose is decided by the project's test of
// the ray, so the visibility is that of the BVH to the bit.
// Called by bench/visibility. For perspective cameras without lens or distortion. Threads are its own for the time
// of a call; the answers depend on the input only.
#pragma once

#include "bench/visible_triangles.h"
#include "engine/scene_tables.h"

namespace shoal::bench {

/// What is rasterised: one ray a pixel, row by row, and where on the film each goes through.
struct FilmSamples {
  uint32_t width = 0, height = 0;
  LargeVector<BenchRay> rays;
  /// In units of the film at distance 1: x to the right, y up.
  std::vector<double> x, y;
};

/// The first sample of each pixel as a render takes it by independent numbers. Fails with: kUsage (another camera).
Result<FilmSamples> camera_samples(const CameraRecord& camera, uint32_t width, uint32_t height);

struct RasterCounts {
  uint64_t binned = 0;      ///< triangles, once for each tile
  uint64_t candidates = 0;  ///< tests of a ray and a triangle
};

class TiledRasterizer {
 public:
  static constexpr uint32_t kTile =
      32;  ///< pixels a side: a tile's rays, ready to be tested, fit the L2 cache (some 270 bytes each)

  /// Puts the triangles into bins. Keeps references to both.
  TiledRasterizer(const VisibleTriangles& triangles, const CameraRecord& camera, const FilmSamples& samples,
                  unsigned threads);

  /// The answer of each sample's ray.
  TeamSeconds draw(std::span<RayAnswer> answers, RasterCounts& counts) const;

  /// Of the bins.
  uint64_t bytes() const;

 private:
  struct Binned {
    float nearest;  ///< no hit has a smaller t
    uint32_t triangle;
  };
  struct View;
  class TileDrawer;

  void bin_range(const View& view, uint32_t first, uint32_t last, std::vector<std::vector<Binned>>& bins) const;

  const VisibleTriangles& triangles_;
  const CameraRecord& camera_;
  const FilmSamples& samples_;
  unsigned threads_;
  uint32_t tiles_x_, tiles_y_;
  std::vector<std::vector<Binned>> bins_;  ///< by tile, nearest first
};

}  // namespace shoal::bench
