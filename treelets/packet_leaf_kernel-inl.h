// Packets of rays in a leaf: every triangle against all rays at once, or ray by ray where few enter. Included once a
// target (foreach_target.h).
#if defined(SHOAL_TREELETS_PACKET_LEAF_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_PACKET_LEAF_KERNEL_INL_H
#undef SHOAL_TREELETS_PACKET_LEAF_KERNEL_INL_H
#else
#define SHOAL_TREELETS_PACKET_LEAF_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/hit_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/packet_state.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

#if HWY_MAX_BYTES >= 32

class PacketLeaves {
 protected:
  static constexpr uint32_t kLanes = static_cast<uint32_t>(kLeafLanes);
  static constexpr uint32_t kRawVertices = kMaxLeafVertices + 16;
  /// A leaf that so few rays enter is tested ray by ray.
  static constexpr uint32_t kMostRaysApart = 5;

  explicit PacketLeaves(TraceCounters& counters) : counters_(counters) {}

  static HWY_INLINE uint32_t bits_of(hn::Mask<F16> mask) {
#if HWY_TARGET <= HWY_AVX3
    return uint32_t{mask.raw};
#endif
    uint8_t bits[8] = {};
    hn::StoreMaskBits(F16(), mask, bits);
    return uint32_t{bits[0]} | uint32_t{bits[1]} << 8;
  }

  /// Adds to the lanes in `rays`.
  static HWY_INLINE void count(uint32_t counts[kMaxPacketRays], uint32_t rays, uint32_t tests) {
    const hn::RebindToUnsigned<F16> u;
    HWY_ALIGN static constexpr uint32_t kBits[16] = {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192,
                                                     16384, 32768};
    const auto bits = hn::Load(u, kBits);
    const auto here = hn::Ne(hn::And(bits, hn::Set(u, rays)), hn::Zero(u));
    hn::Store(hn::Add(hn::Load(u, counts), hn::IfThenElseZero(here, hn::Set(u, tests))), u, counts);
  }

  HWY_INLINE void cross_leaf(Packet& packet, uint32_t ref, uint32_t rays) {
    const F16 f;
    const LeafView leaf(packet.leaves + size_t{4} * leaf_offset(ref));
    count(packet.triangle_tests, rays, leaf.triangle_count);
    if (static_cast<uint32_t>(std::popcount(rays)) <= kMostRaysApart) return cross_leaf_apart(packet, leaf, ref, rays);
    HWY_ALIGN float raw[3][kRawVertices];
    for (size_t first = 0; first < leaf.vertex_count; first += kLeafLanes) {
      hn::StoreU(load_vertices(leaf, packet.k[0], first), f, raw[0] + first);
      hn::StoreU(load_vertices(leaf, packet.k[1], first), f, raw[1] + first);
      hn::StoreU(load_vertices(leaf, packet.k[2], first), f, raw[2] + first);
    }
    HWY_ALIGN float sheared[3][kMaxLeafVertices][kLeafLanes];
    const auto ox = hn::Load(f, packet.origin[0]), oy = hn::Load(f, packet.origin[1]),
               oz = hn::Load(f, packet.origin[2]);
    const auto shear_x = hn::Load(f, packet.shear_x), shear_y = hn::Load(f, packet.shear_y);
    for (uint32_t v = 0; v < leaf.vertex_count; ++v) {
      const auto z = hn::Sub(hn::Set(f, raw[2][v]), oz);
      hn::Store(hn::Sub(hn::Sub(hn::Set(f, raw[0][v]), ox), hn::Mul(shear_x, z)), f, sheared[0][v]);
      hn::Store(hn::Sub(hn::Sub(hn::Set(f, raw[1][v]), oy), hn::Mul(shear_y, z)), f, sheared[1][v]);
      hn::Store(z, f, sheared[2][v]);
    }
    const auto inverse = hn::Load(f, packet.inverse[2]);
    const auto pads = hn::Mul(hn::Set(f, 2.0f), hn::Mul(hn::Load(f, packet.pad), hn::Abs(inverse)));
    const uint8_t *c0 = leaf.corner(0), *c1 = leaf.corner(1), *c2 = leaf.corner(2);
    for (uint32_t i = 0; i < leaf.triangle_count; ++i) {
      const uint32_t v[3] = {c0[i], c1[i], c2[i]};
      ShearedLanes corner[3];
      for (int k = 0; k < 3; ++k) {
        corner[k] = {hn::Load(f, sheared[0][v[k]]), hn::Load(f, sheared[1][v[k]]), hn::Load(f, sheared[2][v[k]])};
      }
      uint32_t left = rays & ~bits_of(edges_differ(corner));
      if (left == 0) continue;
      left &= ~bits_of(out_of_reach(corner, inverse, pads, hn::Load(f, packet.t)));
      if (left == 0) continue;
      if ((left & (left - 1)) == 0 || leaf.has_coverage()) {
        test_rays(packet, leaf, leaf_offset(ref), i, left, rays);
      } else {
        test_together(packet, leaf, leaf_offset(ref), i, left, rays, corner, raw, v);
      }
    }
  }

 private:
  /// The ray in `lane` by itself, for tests of one ray.
  HWY_INLINE const RaySpace& space_of(Packet& packet, uint32_t lane) {
    RaySpace& space = packet.space[lane];
    if ((packet.ready >> lane & 1) != 0) return space;
    packet.ready |= 1u << lane;
    space.kx = packet.k[0], space.ky = packet.k[1], space.kz = packet.k[2];
    for (int i = 0; i < 3; ++i) {
      space.origin[packet.k[i]] = packet.origin[i][lane];
      space.inverse[packet.k[i]] = packet.inverse[i][lane];
    }
    space.direction[space.kz] = packet.direction[space.kz][lane];
    space.shear_x = packet.shear_x[lane], space.shear_y = packet.shear_y[lane];
    space.pad = packet.pad[lane];
    space.extreme = false;  // such rays are in no packet
    return space;
  }

  HWY_INLINE void cross_leaf_apart(Packet& packet, const LeafView& leaf, uint32_t ref, uint32_t rays) {
    for (uint32_t left = rays; left != 0; left &= left - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(left));
      uint32_t found = find_candidates(space_of(packet, lane), leaf, packet.t[lane]);
      for (; found != 0; found &= found - 1) {
        const uint32_t bit = 1u << lane;
        test_rays(packet, leaf, leaf_offset(ref), static_cast<uint32_t>(std::countr_zero(found)), bit, rays);
        if ((packet.alive & bit) == 0) break;
      }
    }
  }

  /// The exact test of a triangle for several rays at once: the bits of intersect_triangle().
  HWY_NOINLINE void test_together(Packet& packet, const LeafView& leaf, uint32_t offset, uint32_t i, uint32_t left,
                                  uint32_t& rays, const ShearedLanes corner[3], const float (*raw)[kRawVertices],
                                  const uint32_t v[3]) {
    const F16 f;
    const hn::Half<F16> h;
    const hn::Repartition<double, F16> d;
    HWY_ALIGN float t_plane[kLanes];
    uint32_t crossed = 0;
    for (uint32_t part = 0; part < 2; ++part) {
      const auto half = [&](V16 x) HWY_ATTR {
        return hn::PromoteTo(d, part != 0 ? hn::UpperHalf(h, x) : hn::LowerHalf(h, x));
      };
      const auto ax = half(corner[0].x), ay = half(corner[0].y), bx = half(corner[1].x), by = half(corner[1].y),
                 cx = half(corner[2].x), cy = half(corner[2].y);
      const auto eu = hn::Sub(hn::Mul(cx, by), hn::Mul(cy, bx)), ev = hn::Sub(hn::Mul(ax, cy), hn::Mul(ay, cx)),
                 ew = hn::Sub(hn::Mul(bx, ay), hn::Mul(by, ax));
      const auto det = hn::Add(hn::Add(eu, ev), ew);
      const auto none = hn::Zero(d);
      const auto negative = hn::Or(hn::Lt(eu, none), hn::Or(hn::Lt(ev, none), hn::Lt(ew, none)));
      const auto positive = hn::Or(hn::Gt(eu, none), hn::Or(hn::Gt(ev, none), hn::Gt(ew, none)));
      const auto missed = hn::Or(hn::And(negative, positive), hn::Eq(det, none));
      const auto inverse = hn::Div(hn::Set(d, 1.0), det);
      const auto sum = hn::Add(hn::Add(hn::Mul(hn::Mul(eu, inverse), half(corner[0].z)),
                                       hn::Mul(hn::Mul(ev, inverse), half(corner[1].z))),
                               hn::Mul(hn::Mul(ew, inverse), half(corner[2].z)));
      const auto t = hn::Div(sum, half(hn::Load(f, packet.direction[packet.k[2]])));
      hn::Store(hn::DemoteTo(h, t), h, t_plane + part * (kLanes / 2));
      uint8_t bits[8] = {};
      hn::StoreMaskBits(d, missed, bits);
      crossed |= (~uint32_t{bits[0]} & ((1u << (kLanes / 2)) - 1)) << (part * (kLanes / 2));
    }
    const auto pad = hn::Load(f, packet.pad);
    auto t_near = hn::Zero(f), t_far = hn::Set(f, std::numeric_limits<float>::infinity());
    for (int axis = 0; axis < 3; ++axis) {
      const float* c = raw[axis];
      const float least = std::min(std::min(c[v[0]], c[v[1]]), c[v[2]]);
      const float most = std::max(std::max(c[v[0]], c[v[1]]), c[v[2]]);
      const auto origin = hn::Load(f, packet.origin[axis]), inverse = hn::Load(f, packet.inverse[axis]),
                 far_inverse = hn::Load(f, packet.far_inverse[axis]);
      const auto lo = hn::Sub(hn::Set(f, least), hn::Add(origin, pad));
      const auto hi = hn::Sub(hn::Set(f, most), hn::Sub(origin, pad));
      t_near = hn::Max(t_near, hn::Min(hn::Mul(lo, inverse), hn::Mul(hi, inverse)));
      t_far = hn::Min(t_far, hn::Max(hn::Mul(lo, far_inverse), hn::Mul(hi, far_inverse)));
    }
    const auto t_max = hn::Load(f, packet.t);
    const auto plane_t = hn::Load(f, t_plane);
    const auto number = hn::Eq(plane_t, plane_t);  // std::max() keeps what is none, and that is no hit
    const auto t = hn::Min(hn::Max(plane_t, t_near), t_far);
    const auto entered = hn::Le(t_near, hn::Min(t_far, t_max));
    left &= crossed & bits_of(number) & bits_of(hn::And(entered, hn::And(hn::Gt(t, hn::Zero(f)), hn::Le(t, t_max))));
    hn::Store(t, f, t_plane);
    const TreeletView treelet(packet.page);
    for (; left != 0; left &= left - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(left));
      // No weights: only coverage needs them, and leaves with coverage go to test_rays().
      take(packet, treelet, leaf, offset, i, lane, {t_plane[lane], 0, 0}, rays);
    }
  }

  HWY_NOINLINE void test_rays(Packet& packet, const LeafView& leaf, uint32_t offset, uint32_t i, uint32_t left,
                              uint32_t& rays) {
    const TreeletView treelet(packet.page);
    for (; left != 0; left &= left - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(left));
      Ray& ray = *packet.rays[lane];
      TriangleHit hit;
      if (!intersect_stored(space_of(packet, lane), leaf, i, ray.t, hit)) continue;
      take(packet, treelet, leaf, offset, i, lane, hit, rays);
    }
  }

  HWY_INLINE void take(Packet& packet, const TreeletView& treelet, const LeafView& leaf, uint32_t offset, uint32_t i,
                       uint32_t lane, const TriangleHit& hit, uint32_t& rays) {
    Ray& ray = *packet.rays[lane];
    if (take_hit(treelet, leaf, offset, i, hit, ray, packet.entry.treelet, counters_)) {
      packet.alive &= ~(1u << lane);
      rays &= ~(1u << lane);
    }
    packet.t[lane] = ray.t;
  }

  TraceCounters& counters_;
};

#endif

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
