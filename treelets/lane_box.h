// Boxes in four lanes (x, y, z, unused) for the builder's inner loops: SSE2 where the target has it, plain loops
// else. Both do the same exact operations (min, max, comparisons and single IEEE roundings), so trees are the same.
// Called by treelets/binned_sah. Plain values.
#pragma once

#include <cstdint>
#include <limits>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "treelets/vector.h"

namespace shoal {

#if defined(__SSE2__)
using Lanes = __m128;
inline Lanes lanes_set(float v) { return _mm_set1_ps(v); }
inline Lanes lanes_set(float x, float y, float z) { return _mm_setr_ps(x, y, z, 0.0f); }
/// Requires: p is 16-byte aligned and four floats long; the fourth lane becomes zero, whatever its bits.
inline Lanes lanes_load3(const float* p) {
  return _mm_and_ps(_mm_load_ps(p), _mm_castsi128_ps(_mm_setr_epi32(-1, -1, -1, 0)));
}
inline void lanes_store(Lanes v, float out[4]) { _mm_storeu_ps(out, v); }
inline Lanes lanes_min(Lanes a, Lanes b) { return _mm_min_ps(a, b); }
inline Lanes lanes_max(Lanes a, Lanes b) { return _mm_max_ps(a, b); }
inline Lanes lanes_add(Lanes a, Lanes b) { return _mm_add_ps(a, b); }
inline Lanes lanes_sub(Lanes a, Lanes b) { return _mm_sub_ps(a, b); }
inline Lanes lanes_mul(Lanes a, Lanes b) { return _mm_mul_ps(a, b); }
/// Towards zero. Requires: in the range of int32.
inline void lanes_truncate(Lanes v, int32_t out[4]) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out), _mm_cvttps_epi32(v));
}
#else
struct Lanes {
  float v[4];
};
inline Lanes lanes_set(float v) { return {{v, v, v, v}}; }
inline Lanes lanes_set(float x, float y, float z) { return {{x, y, z, 0.0f}}; }
inline Lanes lanes_load3(const float* p) { return {{p[0], p[1], p[2], 0.0f}}; }
inline void lanes_store(Lanes v, float out[4]) {
  for (int i = 0; i < 4; ++i) out[i] = v.v[i];
}
template <class F>
inline Lanes lanes_each(Lanes a, Lanes b, F f) {
  return {{f(a.v[0], b.v[0]), f(a.v[1], b.v[1]), f(a.v[2], b.v[2]), f(a.v[3], b.v[3])}};
}
inline Lanes lanes_min(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return x < y ? x : y; });
}
inline Lanes lanes_max(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return x > y ? x : y; });
}
inline Lanes lanes_add(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return x + y; });
}
inline Lanes lanes_sub(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return x - y; });
}
inline Lanes lanes_mul(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return x * y; });
}
inline void lanes_truncate(Lanes v, int32_t out[4]) {
  for (int i = 0; i < 4; ++i) out[i] = static_cast<int32_t>(v.v[i]);
}
#endif

struct LaneBox {
  Lanes lo = lanes_set(std::numeric_limits<float>::infinity());
  Lanes hi = lanes_set(-std::numeric_limits<float>::infinity());

  void include(Lanes point) { lo = lanes_min(lo, point), hi = lanes_max(hi, point); }
  void include(const LaneBox& b) { lo = lanes_min(lo, b.lo), hi = lanes_max(hi, b.hi); }
  Bounds3 bounds() const {
    float l[4], h[4];
    lanes_store(lo, l), lanes_store(hi, h);
    return {{l[0], l[1], l[2]}, {h[0], h[1], h[2]}};
  }
};

/// Half the surface area in double: no finite float box overflows or underflows. Requires: not empty.
inline double half_area(const float lo[3], const float hi[3]) {
  const double x = static_cast<double>(hi[0]) - lo[0];
  const double y = static_cast<double>(hi[1]) - lo[1];
  const double z = static_cast<double>(hi[2]) - lo[2];
  return x * y + y * z + z * x;
}
inline double half_area(const LaneBox& box) {
  float lo[4], hi[4];
  lanes_store(box.lo, lo), lanes_store(box.hi, hi);
  return half_area(lo, hi);
}

}  // namespace shoal
