// What the pixels of a picture hold beside their colour: a plane for every AOV that is asked for, nothing for the others.
// Sums are whole numbers, so that any order of adding gives the same bits (docs/decisions/0004); ids are those of sample
// 0. Called by engine/render_worker and engine/render; there is none in a render without AOVs.
//
// Properties and assumptions
//   range      albedo and normal in units of 2^-40; depth and position in 64.64 fixed point, clamped to +-2^40; variance:
//              engine/exact_variance.h. 2^22 samples fit each sum.
//   threads    any number may add; a striped lock guards a pixel, costs are atomic. resolve() when nobody adds.
//   memory     bytes().
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/aov.h"
#include "engine/exact_variance.h"
#include "engine/film.h"
#include "engine/object_ids.h"
#include "engine/surface_features.h"
#include "io/image.h"

namespace shoal {

class AovFilm {
 public:
  /// For a scene in `file`. Fails with: kCorrupt, kStorage.
  static Result<std::unique_ptr<AovFilm>> create(AovSet set, uint32_t width, uint32_t height, const PageFile& file);
  /// `page_count`: of the file, for what is read ahead.
  AovFilm(AovSet set, uint32_t width, uint32_t height, ObjectIds objects = {}, size_t page_count = 0);
  /// Of create(), of the layers that resolve() makes, and of the picture's file while they are written.
  static uint64_t bytes(AovSet set, uint32_t width, uint32_t height, const PageFile& file);

  AovSet set() const { return set_; }

  /// What the camera ray of a sample hit.
  void add_first_hit(uint32_t pixel, const SurfaceFeatures& features);
  void add_albedo(uint32_t pixel, const Vec3& albedo);
  /// Of sample 0. `material`: from 0 on.
  void set_ids(uint32_t pixel, const Hit& hit, uint32_t material);
  /// The radiance that was added to the film.
  void add_radiance(uint32_t pixel, const Vec3& radiance);
  void add_treelets(uint32_t pixel, uint64_t count) { add_cost(treelets_, pixel, count); }
  void add_bytes(uint32_t pixel, uint64_t count) { add_cost(bytes_, pixel, count); }

  /// A page was read before anyone asked for it; who takes it in hand first is charged.
  void note_read_ahead(PageId page, uint32_t bytes) { read_ahead_[page].store(bytes, std::memory_order_relaxed); }
  uint32_t take_read_ahead(PageId page) {
    return read_ahead_[page].load(std::memory_order_relaxed) == 0 ? 0 : read_ahead_[page].exchange(0);
  }

  /// The sums as they are stored (docs/file_format.md), a plane an AOV that has sums, while nobody adds.
  struct Plane {
    Aov aov;
    std::span<std::byte> bytes;
  };
  std::vector<Plane> planes();
  /// Whether sums are in their range, whatever planes() were filled with.
  bool plausible() const;
  /// What planes() of such a film hold together.
  static uint64_t plane_bytes(AovSet set, uint32_t width, uint32_t height);
  /// Adds the sums of another film, from `first_byte` of its plane of that AOV on. Requires: whole sums.
  void add_plane(Aov aov, uint64_t first_byte, std::span<const std::byte> bytes);

  /// The layers as channels of the file. `film` holds the same samples.
  std::vector<ExrChannel> resolve(const Film& film) const;

 private:
  /// In units of 2^-40.
  using SmallSum = int64_t;
  static constexpr uint32_t kLocks = 4096;

  static void add_cost(std::vector<uint64_t>& plane, uint32_t pixel, uint64_t count) {
    if (!plane.empty()) std::atomic_ref(plane[pixel]).fetch_add(count, std::memory_order_relaxed);
  }
  float value(Aov aov, const Film& film, size_t pixel, int channel) const;
  uint32_t integer(Aov aov, const Film& film, size_t pixel) const;

  AovSet set_;
  std::vector<SmallSum> albedo_, normal_;               // 3 a pixel
  std::vector<FixedPoint128> depth_, position_;         // 1, 3
  std::vector<SquareSum> squares_;                      // 3
  std::vector<uint32_t> object_ids_, material_ids_;
  std::vector<uint64_t> treelets_, bytes_;
  std::vector<std::atomic<uint32_t>> read_ahead_;       // by page: bytes that nobody was charged for
  ObjectIds objects_;
  std::unique_ptr<SpinLock[]> locks_;
};

}  // namespace shoal
