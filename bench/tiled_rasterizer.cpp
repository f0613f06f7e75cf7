#include "bench/tiled_rasterizer.h"

#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>

#include "engine/camera.h"
#include "engine/sampler.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kSeed = 1;
constexpr uint32_t kBinnedAtOnce = 16384;  // triangles of one grab
constexpr uint32_t kLookAgain = 32;        // triangles of a tile after which its farthest hit is found again

/// Rays point a little elsewhere than where they go through the film: the direction is rounded some eight times by
/// 2^-24.
constexpr double kDirectionError = 0x1p-20;
/// Of edge functions in double, over the product of the corners' distances.
constexpr double kEdgeRounding = 0x1p-46;

struct Double3 {
  double x, y, z;
};
Double3 cross(const Double3& a, const Double3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(const Double3& a, const Double3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(const Double3& v) { return std::sqrt(dot(v, v)); }
Double3 to_double(const Vec3& v) { return {v.x, v.y, v.z}; }

Double3 unit(const Vec3& v) {
  const Double3 d = to_double(v);
  const double l = length(d);
  return {d.x / l, d.y / l, d.z / l};
}

/// One side of a triangle as a function of the film: its value is zero in the plane of the side and the eye, and no
/// proposed hit lies farther than `margin` on the other side.
struct Edge {
  double x, y, c, margin;

  double at(double film_x, double film_y) const { return x * film_x + y * film_y + c; }
};

struct FilmBox {
  double lo_x, hi_x, lo_y, hi_y;
};

/// Pixels from lo to hi, both among them.
struct PixelBox {
  uint32_t lo_x, hi_x, lo_y, hi_y;
};

/// Where a triangle may be seen.
struct Seen {
  float nearest;  ///< no hit has a smaller t
  PixelBox box;
};

}  // namespace

/// The camera's space: x to the right, y up, z the distance from the plane of the eye. A point (x, y, z) is seen at
/// the film's (x / z, y / z).
struct TiledRasterizer::View {
  View(const CameraRecord& camera, const VisibleTriangles& triangles, const FilmSamples& samples)
      : width(samples.width),
        height(samples.height),
        half_x(static_cast<double>(camera.tan_half_yfov) * width / height),
        half_y(camera.tan_half_yfov),
        eye(to_double(camera.camera_to_world.translation)),
        reach(std::sqrt(1 + half_x * half_x + half_y * half_y)) {
    const Double3 a = unit(camera.camera_to_world.column_x), b = unit(camera.camera_to_world.column_y),
                  c = unit(camera.camera_to_world.column_z);
    const double det = dot(a, cross(b, c));  // axes need not be orthogonal: rows of the inverse
    const auto row = [det](const Double3& v, double sign) {
      return Double3{sign * v.x / det, sign * v.y / det, sign * v.z / det};
    };
    to_x = row(cross(b, c), 1), to_y = row(cross(c, a), 1), to_z = row(cross(a, b), -1);
    // Corners are moved by pad() along each axis of the world: by 1.8 times that, and more where axes are not
    // orthogonal.
    const double moved = 2 * triangles.pad(camera.camera_to_world.translation);
    corner_error = moved * std::max({1.0, length(to_x), length(to_y), length(to_z)});
  }

  /// Nothing when it lies behind the eye or beside the picture.
  std::optional<Seen> see(const Double3& a, const Double3& b, const Double3& c) const {
    double nearest = std::numeric_limits<double>::max(), farthest = -nearest;
    FilmBox box{nearest, farthest, nearest, farthest};
    bool all_in_front = true;
    for (const Double3& p : {a, b, c}) {
      nearest = std::min(nearest, p.z - corner_error), farthest = std::max(farthest, p.z + corner_error);
      const double z = p.z - corner_error;
      if (z <= corner_error) {
        all_in_front = false;
        continue;
      }
      const double x = p.x / p.z, y = p.y / p.z, error = corner_error / z + kDirectionError;
      box.lo_x = std::min(box.lo_x, x - error * (1 + std::abs(x)));
      box.hi_x = std::max(box.hi_x, x + error * (1 + std::abs(x)));
      box.lo_y = std::min(box.lo_y, y - error * (1 + std::abs(y)));
      box.hi_y = std::max(box.hi_y, y + error * (1 + std::abs(y)));
    }
    if (farthest < 0) return std::nullopt;
    if (!all_in_front) box = {-half_x, half_x, -half_y, half_y};  // seen anywhere
    if (box.hi_x < -half_x || box.lo_x > half_x || box.hi_y < -half_y || box.lo_y > half_y) return std::nullopt;
    // Directions have unit length: t is at least the distance along the axis.
    const double along_axis = nearest / std::max(1.0, length(to_z));
    const auto t_least = static_cast<float>(std::max(0.0, along_axis * (1 - kDirectionError)));
    const auto pixel = [](double share, uint32_t pixels) {
      return static_cast<uint32_t>(std::clamp(std::floor(share * pixels), 0.0, static_cast<double>(pixels - 1)));
    };
    return Seen{t_least,
                {pixel((box.lo_x / half_x + 1) / 2, width), pixel((box.hi_x / half_x + 1) / 2, width),
                 pixel((1 - box.hi_y / half_y) / 2, height), pixel((1 - box.lo_y / half_y) / 2, height)}};
  }

  Double3 point(const Vec3& world) const {
    const Double3 d{world.x - eye.x, world.y - eye.y, world.z - eye.z};
    return {dot(to_x, d), dot(to_y, d), dot(to_z, d)};
  }

  Edge edge(const Double3& a, const Double3& b) const {
    const Double3 e = cross(a, b);
    const double both = length(a) * length(b);
    const double moved = 2 * corner_error * (length(a) + length(b) + 2 * corner_error);
    return {e.x, e.y, e.z, reach * (moved + kDirectionError * length(e) + kEdgeRounding * both)};
  }

  uint32_t width, height;
  double half_x, half_y;  ///< of the film
  Double3 eye, to_x, to_y, to_z;
  double corner_error = 0;  ///< of a corner in the camera's space
  double reach;             ///< longest direction through the film
};

Result<FilmSamples> camera_samples(const CameraRecord& record, uint32_t width, uint32_t height) {
  if (record.perspective == 0 || record.key_count != 0) {
    return Error{ErrorCode::kUsage, "a perspective camera that stands still is needed"};
  }
  FilmSamples samples{width, height, {}, {}, {}};
  const Camera camera(record, width, height);
  const double scale_y = record.tan_half_yfov, scale_x = scale_y * width / height;
  samples.rays.resize(size_t{width} * height);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const uint32_t pixel = y * width + x;
      const Random4 random = random4(kSeed, pixel, 0, 0, Dimension::kPixel);
      const CameraRay ray = camera.ray(x, y, random);
      samples.rays[pixel] = {ray.origin, kRayInfinity, ray.direction};
      samples.x.push_back((2 * (x + static_cast<double>(random.uniform(0))) / width - 1) * scale_x);
      samples.y.push_back((1 - 2 * (y + static_cast<double>(random.uniform(1))) / height) * scale_y);
    }
  }
  return samples;
}

TiledRasterizer::TiledRasterizer(const VisibleTriangles& triangles, const CameraRecord& camera,
                                 const FilmSamples& samples, unsigned threads)
    : triangles_(triangles),
      camera_(camera),
      samples_(samples),
      threads_(threads),
      tiles_x_((samples.width + kTile - 1) / kTile),
      tiles_y_((samples.height + kTile - 1) / kTile),
      bins_(size_t{tiles_x_} * tiles_y_) {
  const View view(camera, triangles, samples);
  std::atomic<uint64_t> next{0};
  std::mutex mutex;
  run_together(threads, [&](unsigned) {
    std::vector<std::vector<Binned>> bins(bins_.size());
    const uint64_t count = triangles.triangles.size();
    for (uint64_t first; (first = next.fetch_add(kBinnedAtOnce)) < count;) {
      bin_range(view, static_cast<uint32_t>(first), static_cast<uint32_t>(std::min(first + kBinnedAtOnce, count)),
                bins);
    }
    const std::lock_guard guard(mutex);
    for (size_t tile = 0; tile < bins.size(); ++tile) {
      bins_[tile].insert(bins_[tile].end(), bins[tile].begin(), bins[tile].end());
    }
  });
  std::atomic<size_t> next_tile{0};
  run_together(threads, [&](unsigned) {
    for (size_t tile; (tile = next_tile++) < bins_.size();) {
      std::sort(bins_[tile].begin(), bins_[tile].end(), [](const Binned& a, const Binned& b) {
        return a.nearest != b.nearest ? a.nearest < b.nearest : a.triangle < b.triangle;
      });
    }
  });
}

void TiledRasterizer::bin_range(const View& view, uint32_t first, uint32_t last,
                                std::vector<std::vector<Binned>>& bins) const {
  for (uint32_t i = first; i < last; ++i) {
    Vec3 world[3];
    triangles_.place(triangles_.triangles[i], world);
    const std::optional<Seen> seen = view.see(view.point(world[0]), view.point(world[1]), view.point(world[2]));
    if (!seen) continue;
    const PixelBox& box = seen->box;
    for (uint32_t y = box.lo_y / kTile; y <= box.hi_y / kTile; ++y) {
      for (uint32_t x = box.lo_x / kTile; x <= box.hi_x / kTile; ++x) {
        bins[size_t{y} * tiles_x_ + x].push_back({seen->nearest, i});
      }
    }
  }
}

class TiledRasterizer::TileDrawer {
 public:
  TileDrawer(const TiledRasterizer& all, const View& view) : all_(all), view_(view) {}

  void draw(uint32_t tile_x, uint32_t tile_y, std::span<RayAnswer> answers, RasterCounts& counts) {
    begin(tile_x, tile_y);
    const std::vector<Binned>& bin = all_.bins_[size_t{tile_y} * all_.tiles_x_ + tile_x];
    counts.binned += bin.size();
    float farthest = kRayInfinity;
    for (size_t i = 0; i < bin.size() && bin[i].nearest <= farthest; ++i) {
      draw_triangle(bin[i], counts);
      if (i % kLookAgain != kLookAgain - 1) continue;
      farthest = 0;
      for (uint32_t p = 0; p < count_; ++p) farthest = std::max(farthest, rays_[p].t);
    }
    for (uint32_t p = 0; p < count_; ++p) answers[pixel_[p]] = answer_of(rays_[p]);
  }

 private:
  static constexpr uint32_t kPixels = kTile * kTile;

  void begin(uint32_t tile_x, uint32_t tile_y) {
    const FilmSamples& samples = all_.samples_;
    first_x_ = tile_x * kTile, first_y_ = tile_y * kTile;
    wide_ = std::min(kTile, samples.width - first_x_), high_ = std::min(kTile, samples.height - first_y_);
    count_ = 0;
    area_ = {1e300, -1e300, 1e300, -1e300};
    for (uint32_t y = first_y_; y < first_y_ + high_; ++y) {
      for (uint32_t x = first_x_; x < first_x_ + wide_; ++x) {
        const uint32_t pixel = y * samples.width + x, p = count_++;
        pixel_[p] = pixel;
        x_[p] = samples.x[pixel], y_[p] = samples.y[pixel];
        area_.lo_x = std::min(area_.lo_x, x_[p]), area_.hi_x = std::max(area_.hi_x, x_[p]);
        area_.lo_y = std::min(area_.lo_y, y_[p]), area_.hi_y = std::max(area_.hi_y, y_[p]);
        rays_[p] = begin_ray(samples.rays[pixel], pixel, false);
        space_of_[p] = kNoIndex;
      }
    }
  }

  /// Whether a side's function is below its margin everywhere in the tile (sign 1), or above (-1).
  bool outside(const Edge& e, double sign) const {
    const double x = (e.x * sign > 0) ? area_.hi_x : area_.lo_x, y = (e.y * sign > 0) ? area_.hi_y : area_.lo_y;
    return sign * e.at(x, y) < -e.margin;
  }

  void draw_triangle(const Binned& binned, RasterCounts& counts) {
    const VisibleTriangle& triangle = all_.triangles_.triangles[binned.triangle];
    Vec3 world[3];
    all_.triangles_.place(triangle, world);
    const Double3 a = view_.point(world[0]), b = view_.point(world[1]), c = view_.point(world[2]);
    const Edge e[3] = {view_.edge(a, b), view_.edge(b, c), view_.edge(c, a)};
    const bool none_above = outside(e[0], 1) || outside(e[1], 1) || outside(e[2], 1);
    const bool none_below = outside(e[0], -1) || outside(e[1], -1) || outside(e[2], -1);
    if (none_above && none_below) return;
    const std::optional<Seen> seen = view_.see(a, b, c);
    if (!seen) return;
    const PixelBox& box = seen->box;
    const uint32_t x0 = std::max(box.lo_x, first_x_) - first_x_, x1 = std::min(box.hi_x - first_x_, wide_ - 1);
    const uint32_t y0 = std::max(box.lo_y, first_y_) - first_y_, y1 = std::min(box.hi_y - first_y_, high_ - 1);
    for (uint32_t y = y0; y <= y1; ++y) {
      for (uint32_t p = y * wide_ + x0; p <= y * wide_ + x1; ++p) {
        if (binned.nearest <= rays_[p].t && proposed(e, x_[p], y_[p])) test(triangle, p, counts);
      }
    }
  }

  static bool proposed(const Edge e[3], double x, double y) {
    const double u = e[0].at(x, y), v = e[1].at(x, y), w = e[2].at(x, y);
    const bool below = (u < -e[0].margin) | (v < -e[1].margin) | (w < -e[2].margin);
    const bool above = (u > e[0].margin) | (v > e[1].margin) | (w > e[2].margin);
    return !(below & above);
  }

  void test(const VisibleTriangle& triangle, uint32_t p, RasterCounts& counts) {
    ++counts.candidates;
    if (space_of_[p] != triangle.instance) {
      spaces_[p] = to_object_space(rays_[p], all_.triangles_.tree->instance(triangle.instance));
      space_of_[p] = triangle.instance;
    }
    test_visible(triangle, spaces_[p], rays_[p]);
  }

  const TiledRasterizer& all_;
  const View& view_;
  uint32_t first_x_ = 0, first_y_ = 0, wide_ = 0, high_ = 0, count_ = 0;
  FilmBox area_{};  ///< of the samples
  uint32_t pixel_[kPixels];
  double x_[kPixels], y_[kPixels];
  Ray rays_[kPixels];
  RaySpace spaces_[kPixels];
  uint32_t space_of_[kPixels];  ///< instance; kNoIndex: none yet
};

TeamSeconds TiledRasterizer::draw(std::span<RayAnswer> answers, RasterCounts& counts) const {
  const View view(camera_, triangles_, samples_);
  std::atomic<uint32_t> next{0};
  std::mutex mutex;
  return run_together(threads_, [&](unsigned) {
    const auto drawer = std::make_unique<TileDrawer>(*this, view);
    RasterCounts own;
    for (uint32_t tile; (tile = next++) < tiles_x_ * tiles_y_;)
      drawer->draw(tile % tiles_x_, tile / tiles_x_, answers, own);
    const std::lock_guard guard(mutex);
    counts.binned += own.binned, counts.candidates += own.candidates;
  });
}

uint64_t TiledRasterizer::bytes() const {
  uint64_t bytes = bins_.size() * sizeof(bins_[0]);
  for (const std::vector<Binned>& bin : bins_) bytes += bin.size() * sizeof(Binned);
  return bytes;
}

}  // namespace shoal::bench
