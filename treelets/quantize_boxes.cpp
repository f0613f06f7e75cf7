#include "treelets/quantize_boxes.h"

#include <cmath>

namespace shoal {
namespace {

constexpr double kGridMax = 255;

// The largest q whose plane is at or below `value`.
uint8_t lower_plane(float value, float origin, float step) {
  const double exact = std::floor((static_cast<double>(value) - origin) / step);
  uint32_t q = static_cast<uint32_t>(std::clamp(exact, 0.0, kGridMax));
  while (q > 0 && !(grid_plane(origin, q, step) <= value)) --q;
  while (q < 255 && grid_plane(origin, q + 1, step) <= value) ++q;
  return static_cast<uint8_t>(q);
}

// The smallest q whose plane is at or above `value`, or 256 when there is none.
uint32_t upper_plane(float value, float origin, float step) {
  const double exact = std::ceil((static_cast<double>(value) - origin) / step);
  uint32_t q = static_cast<uint32_t>(std::clamp(exact, 0.0, kGridMax));
  while (q > 0 && grid_plane(origin, q - 1, step) >= value) --q;
  while (q < 256 && !(grid_plane(origin, q, step) >= value)) ++q;
  return q;
}

// Fills one axis with steps of 2^exponent, or returns false: too fine for some child.
bool try_exponent(std::span<const Bounds3> boxes, int axis, int exponent, QuantizedNode& node) {
  const float origin = node.origin[axis];
  const float step = std::ldexp(1.0f, exponent);
  for (size_t i = 0; i < boxes.size(); ++i) {
    const uint32_t hi = upper_plane(boxes[i].hi[axis], origin, step);
    if (hi > 255) return false;
    node.lo[axis][i] = lower_plane(boxes[i].lo[axis], origin, step);
    node.hi[axis][i] = static_cast<uint8_t>(hi);
  }
  node.exponent[axis] = static_cast<int8_t>(exponent);
  return true;
}

}  // namespace

void quantize_boxes(std::span<const Bounds3> boxes, QuantizedNode& node) {
  Bounds3 all;
  for (const Bounds3& box : boxes) all.include(box);
  node.child_count = static_cast<uint8_t>(boxes.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < 8; ++i) node.lo[axis][i] = 255, node.hi[axis][i] = 0;
    node.origin[axis] = all.lo[axis];
    const double extent = static_cast<double>(all.hi[axis]) - all.lo[axis];
    int exponent = kMinGridExponent;
    if (extent > 0) exponent = std::max(exponent, std::ilogb(extent / kGridMax));
    while (!try_exponent(boxes, axis, exponent, node)) {
      // At kMaxGridExponent every plane from q = 2 on is infinite, which encloses anything.
      if (++exponent > kMaxGridExponent) break;
    }
  }
}

}  // namespace shoal
