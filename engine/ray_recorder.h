// Takes down the rays of a render as they are born, with what each was born as. Made by engine/ray_kinds, called by
// engine/render_worker where RenderHooks::recorder is set; a render without one pays a branch a vertex.
//
// Properties and assumptions
//   capacity   none: who renders bounds the paths. At most one ray of each kind and bounce is of one path; memory: bytes().
//   order      take() sorts: what the threads did, and in which order, does not show.
//   threads    lists of their own; take() when none adds any more.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "engine/path_state.h"
#include "engine/query_ray.h"
#include "engine/ray_birth.h"

namespace shoal {

/// The rays of one kind, in the order in which a picture's samples begin (engine/sample_order.h: tile by tile of 32 x 32
/// pixels, in a tile row by row, of a pixel sample by sample).
struct RecordedKind {
  RayBirth birth = RayBirth::kCamera;
  uint32_t bounce = 0;  ///< shadow rays: the vertex that they leave; others: the vertex that they go to
  std::vector<QueryRay> rays;
};

class RayRecorder {
 public:
  static constexpr uint32_t kTile = 32;  ///< as SampleOrder's

  /// Of a picture so many pixels wide, rendered by so many threads.
  RayRecorder(uint32_t width, unsigned threads) : width_(width), threads_(threads) {}

  void add(unsigned thread, RayBirth birth, uint32_t bounce, const PathState& path, const Ray& ray) {
    std::vector<std::deque<Record>>& kinds = threads_[thread].kinds;
    const size_t kind = size_t{bounce} * kRayBirthNames.size() + static_cast<size_t>(birth);
    if (kind >= kinds.size()) kinds.resize(kind + 1);
    kinds[kind].push_back({key_of(path), ray.origin, ray.direction, ray.t, ray.alpha_seed});
  }

  /// All kinds that there are, by birth, then bounce. What was taken is gone.
  std::vector<RecordedKind> take();

  /// Most that so many paths with so many scattering events take, while their rays are taken too.
  static uint64_t bytes(uint64_t paths, uint64_t bounces) {
    return paths * ((1 + 2 * bounces) * sizeof(Record) + sizeof(Record) + sizeof(QueryRay));
  }

 private:
  struct Record {
    uint64_t key;
    Vec3 origin, direction;
    float t;
    uint32_t seed;
  };
  struct alignas(64) Thread {  // on cache lines of its own
    std::vector<std::deque<Record>> kinds;  ///< bounce by bounce, of each all births
  };

  /// Ascends as samples begin.
  uint64_t key_of(const PathState& path) const {
    const uint32_t x = path.pixel % width_, y = path.pixel / width_;
    const uint64_t tile = uint64_t{y / kTile} * ((width_ + kTile - 1) / kTile) + x / kTile;
    return ((tile * kTile + y % kTile) * kTile + x % kTile) << kSampleBits | path.sample;
  }
  static constexpr uint32_t kSampleBits = 23;  // --spp ends at 2^22

  uint32_t width_;
  std::vector<Thread> threads_;
};

}  // namespace shoal
