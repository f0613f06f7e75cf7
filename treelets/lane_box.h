// Boxes in four lanes (x, y, z, unused) for the builder's inner loops: SSE2 where the target has it, plain loops
// else. Both do the same exact operations (min, max, comparisons and single IEEE roundings), so trees are the same.
// Called by treelets/binned_sah and treelets/triangle_test. Plain values.
#pragma once

#include <bit>
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
inline Lanes lanes_load_unaligned(const float p[4]) { return _mm_loadu_ps(p); }
/// {y, z, w, x}.
inline Lanes lanes_rotate4(Lanes a) { return _mm_shuffle_ps(a, a, _MM_SHUFFLE(0, 3, 2, 1)); }
inline void lanes_store(Lanes v, float out[4]) { _mm_storeu_ps(out, v); }
/// Minima and maxima give `b` where `a` is not a number.
inline Lanes lanes_min(Lanes a, Lanes b) { return _mm_min_ps(a, b); }
inline Lanes lanes_max(Lanes a, Lanes b) { return _mm_max_ps(a, b); }
inline Lanes lanes_add(Lanes a, Lanes b) { return _mm_add_ps(a, b); }
inline Lanes lanes_sub(Lanes a, Lanes b) { return _mm_sub_ps(a, b); }
inline Lanes lanes_mul(Lanes a, Lanes b) { return _mm_mul_ps(a, b); }
/// Towards zero. Requires: in the range of int32.
inline void lanes_truncate(Lanes v, int32_t out[4]) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out), _mm_cvttps_epi32(v));
}
/// Lanes where the comparison holds are all ones (not a number), the others zero.
inline Lanes lanes_less(Lanes a, Lanes b) { return _mm_cmplt_ps(a, b); }
inline Lanes lanes_at_most(Lanes a, Lanes b) { return _mm_cmple_ps(a, b); }
inline Lanes lanes_equal(Lanes a, Lanes b) { return _mm_cmpeq_ps(a, b); }
inline Lanes lanes_and(Lanes a, Lanes b) { return _mm_and_ps(a, b); }
inline Lanes lanes_or(Lanes a, Lanes b) { return _mm_or_ps(a, b); }
inline Lanes lanes_not(Lanes a) { return _mm_xor_ps(a, _mm_castsi128_ps(_mm_set1_epi32(-1))); }
/// Bit i: the sign of lane i.
inline int lanes_mask(Lanes a) { return _mm_movemask_ps(a); }
/// {y, z, x, w}.
inline Lanes lanes_rotate3(Lanes a) { return _mm_shuffle_ps(a, a, _MM_SHUFFLE(3, 0, 2, 1)); }
/// Lane k: the first three lanes of a[k], summed in order; lane 3 is zero.
inline Lanes lanes_sum3(const Lanes a[3]) {
  Lanes x = a[0], y = a[1], z = a[2], w = _mm_setzero_ps();
  _MM_TRANSPOSE4_PS(x, y, z, w);
  return _mm_add_ps(_mm_add_ps(x, y), z);
}

using IntLanes = __m128i;
inline IntLanes int_lanes_set(int32_t v) { return _mm_set1_epi32(v); }
/// Requires: 16-byte aligned.
inline IntLanes int_lanes_load(const int32_t p[4]) { return _mm_load_si128(reinterpret_cast<const __m128i*>(p)); }
inline IntLanes int_lanes_add(IntLanes a, IntLanes b) { return _mm_add_epi32(a, b); }
inline IntLanes int_lanes_sub(IntLanes a, IntLanes b) { return _mm_sub_epi32(a, b); }
inline IntLanes int_lanes_shift_right(IntLanes a, int bits) { return _mm_srl_epi32(a, _mm_cvtsi32_si128(bits)); }
inline Lanes lanes_convert(IntLanes a) { return _mm_cvtepi32_ps(a); }
#else
struct Lanes {
  float v[4];
};
inline Lanes lanes_set(float v) { return {{v, v, v, v}}; }
inline Lanes lanes_set(float x, float y, float z) { return {{x, y, z, 0.0f}}; }
inline Lanes lanes_load3(const float* p) { return {{p[0], p[1], p[2], 0.0f}}; }
inline Lanes lanes_load_unaligned(const float p[4]) { return {{p[0], p[1], p[2], p[3]}}; }
inline Lanes lanes_rotate4(Lanes a) { return {{a.v[1], a.v[2], a.v[3], a.v[0]}}; }
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
template <class F>
inline Lanes lanes_each_bits(Lanes a, Lanes b, F f) {
  return lanes_each(a, b, [f](float x, float y) {
    return std::bit_cast<float>(f(std::bit_cast<uint32_t>(x), std::bit_cast<uint32_t>(y)));
  });
}
inline Lanes lanes_less(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return std::bit_cast<float>(x < y ? ~0u : 0u); });
}
inline Lanes lanes_at_most(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return std::bit_cast<float>(x <= y ? ~0u : 0u); });
}
inline Lanes lanes_equal(Lanes a, Lanes b) {
  return lanes_each(a, b, [](float x, float y) { return std::bit_cast<float>(x == y ? ~0u : 0u); });
}
inline Lanes lanes_and(Lanes a, Lanes b) {
  return lanes_each_bits(a, b, [](uint32_t x, uint32_t y) { return x & y; });
}
inline Lanes lanes_or(Lanes a, Lanes b) {
  return lanes_each_bits(a, b, [](uint32_t x, uint32_t y) { return x | y; });
}
inline Lanes lanes_not(Lanes a) {
  return lanes_each_bits(a, a, [](uint32_t x, uint32_t) { return ~x; });
}
inline int lanes_mask(Lanes a) {
  int mask = 0;
  for (int i = 0; i < 4; ++i) mask |= static_cast<int>(std::bit_cast<uint32_t>(a.v[i]) >> 31) << i;
  return mask;
}
inline Lanes lanes_rotate3(Lanes a) { return {{a.v[1], a.v[2], a.v[0], a.v[3]}}; }
inline Lanes lanes_sum3(const Lanes a[3]) {
  Lanes sum{};
  for (int i = 0; i < 3; ++i) sum.v[i] = (a[i].v[0] + a[i].v[1]) + a[i].v[2];
  return sum;
}

struct IntLanes {
  int32_t v[4];
};
inline IntLanes int_lanes_set(int32_t v) { return {{v, v, v, v}}; }
inline IntLanes int_lanes_load(const int32_t p[4]) { return {{p[0], p[1], p[2], p[3]}}; }
inline IntLanes int_lanes_add(IntLanes a, IntLanes b) {
  for (int i = 0; i < 4; ++i) a.v[i] += b.v[i];
  return a;
}
inline IntLanes int_lanes_sub(IntLanes a, IntLanes b) {
  for (int i = 0; i < 4; ++i) a.v[i] -= b.v[i];
  return a;
}
inline IntLanes int_lanes_shift_right(IntLanes a, int bits) {
  for (int i = 0; i < 4; ++i) a.v[i] = static_cast<int32_t>(static_cast<uint32_t>(a.v[i]) >> bits);
  return a;
}
inline Lanes lanes_convert(IntLanes a) {
  Lanes out;
  for (int i = 0; i < 4; ++i) out.v[i] = static_cast<float>(a.v[i]);
  return out;
}
#endif

/// Without signs.
inline Lanes lanes_absolute(Lanes a) { return lanes_and(a, lanes_not(lanes_set(-0.0f))); }
/// Bits of `a` where `mask` is set, of `b` elsewhere.
inline Lanes lanes_select(Lanes mask, Lanes a, Lanes b) {
  return lanes_or(lanes_and(mask, a), lanes_and(lanes_not(mask), b));
}

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
