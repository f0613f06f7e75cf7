// A list of rays while an order traces it: what the render loops have in the place of a camera, materials and a film.
// RenderWorker turns to it where RenderContext::list is set, so that the orders do not know the difference: "sample" i
// is ray i, a path ends where its ray does, and what would be added to the film is the ray's answer.
//
// Properties and assumptions
//   ownership  refers to the caller's rays; each is answered once, by the thread that ends its path.
//   threads    any number.
//   vertices   only where points are asked for: then a closest hit is "shaded" with its treelet in hand, which finds
//              the barycentrics. Attributes and textures are never asked for.
#pragma once

#include <atomic>
#include <cstddef>
#include <span>

#include "engine/object_ids.h"
#include "engine/path_state.h"
#include "engine/query_ray.h"
#include "treelets/top_tree.h"
#include "treelets/triangle_test_kind.h"

namespace shoal {

class RayList {
 public:
  struct Questions {
    RayQuery query = RayQuery::kClosest;
    bool coverage = true;  ///< of the scene or wished for: else every triangle is there
    bool points = false;   ///< RayHit::u and v
    TriangleTest triangle_test = TriangleTest::kWatertight;
  };
  RayList(RaySource& rays, const Questions& questions, const ObjectIds& objects)
      : rays_(rays), questions_(questions), objects_(objects) {}

  uint64_t refused_count() const { return refused_; }

  /// Sets up `path` for ray `index`. The ray has no path and no kind yet: a ray that cannot hit has t < 0.
  Ray begin(uint64_t index, PathState& path);
  bool any_hit() const { return questions_.query == RayQuery::kAny; }
  /// The ray's answer is known. Without a vertex to come the path has no kPathGoesOn any more.
  void finish(const Ray& ray, PathState& path);
  /// The vertex of a path: `geometry` is the page of the treelet that was hit.
  void find_point(const PathState& path, const TopTree& tree, std::span<const std::byte> geometry);

 private:
  RayHit closest_hit(const PathState& path, const QueryRay& asked) const;

  RaySource& rays_;
  Questions questions_;
  const ObjectIds& objects_;
  std::atomic<uint64_t> refused_{0};
};

}  // namespace shoal
