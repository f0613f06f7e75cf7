// From the corners of a triangle to the reference that the tree is built over, and which triangles are left out.
// Called by treelets/build_forest and by the engine where it measures triangles for chunks: both must agree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "io/huge_memory.h"
#include "treelets/binned_sah.h"
#include "treelets/lane_box.h"

namespace shoal {

/// Corners farther out (or not finite) are skipped: up to here no box, grid plane or edge overflows a float.
inline constexpr float kMaxCoordinate = 0x1p125f;

/// The corners of a triangle of nine floats; the last lane of each is something else.
struct CornerLanes {
  explicit CornerLanes(const float* p)
      : a(lanes_load_unaligned(p)),
        b(lanes_load_unaligned(p + 3)),
        c(lanes_rotate4(lanes_load_unaligned(p + 5))) {}  // p + 6 would read a float too many

  Lanes a, b, c;
};

inline bool is_degenerate(const CornerLanes& t) {
  const auto all_three = [](Lanes lanes) { return (lanes_mask(lanes) & 7) == 7; };
  const Lanes largest = lanes_set(kMaxCoordinate);
  const auto in_range = [largest](Lanes corner) { return lanes_at_most(lanes_absolute(corner), largest); };
  if (!all_three(lanes_and(lanes_and(in_range(t.a), in_range(t.b)), in_range(t.c)))) return true;
  return all_three(lanes_equal(t.a, t.b)) || all_three(lanes_equal(t.b, t.c)) || all_three(lanes_equal(t.c, t.a));
}

/// Two corners with equal bits (zeros compared without sign), or a coordinate out of range or not a number.
inline bool is_degenerate(const float* p) { return is_degenerate(CornerLanes(p)); }

/// Requires: not degenerate.
inline BuildRef make_triangle_ref(const CornerLanes& t, uint32_t triangle) {
  // One zero only: the minimum of -0 and +0 would depend on their order.
  const Lanes zero = lanes_set(0.0f);
  alignas(16) float lo[4], hi[4];
  lanes_store(lanes_add(lanes_min(lanes_min(t.a, t.b), t.c), zero), lo);
  lanes_store(lanes_add(lanes_max(lanes_max(t.a, t.b), t.c), zero), hi);
  return {{lo[0], lo[1], lo[2]}, triangle, {hi[0], hi[1], hi[2]}, 0};
}
inline BuildRef make_triangle_ref(const float* p, uint32_t triangle) {
  return make_triangle_ref(CornerLanes(p), triangle);
}

/// References on large pages of their own.
class RefArray {
 public:
  RefArray() : RefArray(0) {}
  explicit RefArray(size_t count) : memory_(count), count_(count) {}

  std::span<BuildRef> refs() const { return {memory_.data(), count_}; }
  size_t size() const { return count_; }
  /// Forgets those behind the first `count`. Requires: there are as many.
  void truncate(size_t count) { count_ = count; }

 private:
  HugeArray<BuildRef> memory_;
  size_t count_;
};

/// References to the triangles that are not degenerate, in order; `positions`: nine floats a triangle. Parallel inside.
RefArray make_refs(std::span<const float> positions);

}  // namespace shoal
