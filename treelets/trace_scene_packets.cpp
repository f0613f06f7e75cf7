// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_scene_packets.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include <hwy/cache_control.h>

#include "treelets/node_kernel-inl.h"
#include "treelets/packet_leaf_kernel-inl.h"
#include "treelets/packet_state.h"
#include "treelets/touch_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

#if HWY_MAX_BYTES >= 32

/// One call: packets from the stream, several in turn.
/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <class Meter = NoTouches>
class PacketRun : private PacketLeaves {
 public:
  PacketRun(const SceneTables& tables, PacketState& state, RayStream& stream, TraceCounters& counters,
            PacketUse& use, Meter meter = {})
      : PacketLeaves(counters),
        tables_(tables),
        state_(state),
        stream_(stream),
        counters_(counters),
        use_(use),
        meter_(meter) {}

  /// `most` full packets, and when the stream ends before, what is left over.
  HWY_INLINE void run(uint64_t most) {
    Packet* walks[kPacketsInTurn];  // first those under way
    for (uint32_t i = 0; i < kPacketsInTurn; ++i) walks[i] = &state_.packets[i];
    uint32_t active = 0;
    for (;;) {
      for (; active < kPacketsInTurn && use_.packets < most; ++active) {
        if (!take_full(*walks[active]) && !(active == 0 && take_waiting(*walks[0]))) break;
        begin(*walks[active]);
        ++use_.packets;
      }
      if (active == 0) return;
      for (uint32_t i = 0; i < active;) {
        if (step(*walks[i])) {
          ++i;
        } else {
          finish(*walks[i]);
          std::swap(walks[i], walks[--active]);
        }
      }
    }
  }

 private:
  /// Rays from the stream until as many of a kind are there as a packet holds; false when the stream has no more.
  HWY_INLINE bool take_full(Packet& packet) {
    while (Ray* ray = stream_.next()) {
      ray->instance = 0;
      const Vec3& d = ray->direction;
      const uint32_t signs = std::bit_cast<uint32_t>(d.x) >> 31 | std::bit_cast<uint32_t>(d.y) >> 31 << 1 |
                             std::bit_cast<uint32_t>(d.z) >> 31 << 2;
      WaitingRays& kind = state_.waiting[signs * 3 + longest_axis(d)];
      kind.rays[kind.count++] = ray;
      if (kind.count == kLanes) return fill(packet, kind);
    }
    return false;
  }

  /// What waits for others of its kind; false when nothing does.
  HWY_INLINE bool take_waiting(Packet& packet) {
    for (WaitingRays& kind : state_.waiting) {
      if (kind.count > 0) return fill(packet, kind);
    }
    return false;
  }

  static HWY_INLINE bool fill(Packet& packet, WaitingRays& kind) {
    packet.count = kind.count;
    for (uint32_t i = 0; i < kLanes; ++i) packet.rays[i] = kind.rays[i < kind.count ? i : 0];
    kind.count = 0;
    return true;
  }

  /// Everything of the rays, by the operations of prepare_ray() and set_pad() (treelets/ray_space.h).
  HWY_INLINE void prepare(Packet& packet) {
    const F16 f;
    for (uint32_t i = 0; i < kLanes; ++i) {  // lanes without a ray get what the first one has
      const Ray& ray = *packet.rays[i];
      touch_write(meter_, &ray, sizeof(Ray), TouchKind::kInHand);  // at its hit, or when it is done
      for (int axis = 0; axis < 3; ++axis) packet.world_origin[axis][i] = ray.origin[axis];
      for (int axis = 0; axis < 3; ++axis) packet.direction[axis][i] = ray.direction[axis];
      packet.t[i] = ray.t;
      packet.node_tests[i] = packet.triangle_tests[i] = packet.treelets[i] = 0;
    }
    const Vec3& first = packet.rays[0]->direction;
    for (int axis = 0; axis < 3; ++axis) packet.negative[axis] = std::signbit(first[axis]) ? 1 : 0;
    packet.k[2] = longest_axis(first);
    packet.k[0] = packet.k[2] == 2 ? 0 : packet.k[2] + 1;
    packet.k[1] = packet.k[0] == 2 ? 0 : packet.k[0] + 1;
    const float extent = tables_.instances[0].max_abs_coordinate;
    const auto most_float = hn::Set(f, std::numeric_limits<float>::max());
    V16 origin[3], direction[3], inverse[3];
    auto reach = hn::Zero(f);
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = hn::Load(f, packet.world_origin[axis]), direction[axis] = hn::Load(f, packet.direction[axis]);
      const auto quotient = hn::Div(hn::Set(f, 1.0f), direction[axis]);
      inverse[axis] = hn::Min(hn::Max(quotient, hn::Neg(most_float)), most_float);
      reach = hn::Max(reach, hn::Abs(origin[axis]));
    }
    reach = hn::Add(reach, hn::Set(f, extent));
    const auto pad = hn::Add(hn::Mul(hn::Set(f, kObjectPad), reach), hn::Set(f, std::numeric_limits<float>::min()));
    const auto node_pad = hn::Add(pad, hn::Mul(hn::Set(f, kNodePad), reach));
    const auto least = hn::Abs(inverse[packet.k[2]]), most = hn::Mul(least, hn::Set(f, kMaxSlope));
    auto largest = hn::Zero(f);
    for (int axis = 0; axis < 3; ++axis) {
      const auto slope = hn::Min(hn::Max(inverse[axis], hn::Neg(most)), most);
      const auto toward = packet.negative[axis] != 0 ? hn::Neg(node_pad) : node_pad;
      hn::Store(slope, f, packet.slope[axis]);
      hn::Store(hn::Neg(hn::Mul(hn::Add(origin[axis], toward), slope)), f, packet.near_bias[axis]);
      hn::Store(hn::Neg(hn::Mul(hn::Sub(origin[axis], toward), slope)), f, packet.far_bias[axis]);
      largest = hn::Max(largest, hn::Abs(slope));
    }
    for (int i = 0; i < 3; ++i) {
      hn::Store(origin[packet.k[i]], f, packet.origin[i]);
      hn::Store(inverse[packet.k[i]], f, packet.inverse[i]);
      const auto enlarged = hn::Mul(inverse[packet.k[i]], hn::Set(f, kFarScale));
      hn::Store(hn::Min(hn::Max(enlarged, hn::Neg(most_float)), most_float), f, packet.far_inverse[i]);
    }
    hn::Store(hn::Div(direction[packet.k[0]], direction[packet.k[2]]), f, packet.shear_x);
    hn::Store(hn::Div(direction[packet.k[1]], direction[packet.k[2]]), f, packet.shear_y);
    hn::Store(pad, f, packet.pad);
    const auto sloped = hn::And(hn::Gt(least, hn::Set(f, 1 / kMaxSlope)), hn::Lt(least, hn::Set(f, kMostLeastSlope)));
    const auto usual = hn::And(hn::Lt(hn::Mul(largest, reach), hn::Set(f, 0x1p100f)),
                               hn::And(sloped, hn::Gt(reach, hn::Set(f, 0x1p-60f))));
    packet.alive = ((1u << packet.count) - 1) & bits_of(usual);
    packet.extreme = ((1u << packet.count) - 1) & ~packet.alive;
    packet.ready = 0;
  }

  static HWY_INLINE uint32_t longest_axis(const Vec3& d) {
    const float ax = std::abs(d.x), ay = std::abs(d.y), az = std::abs(d.z);
    const uint32_t x_longest = (ax > ay) & (ax > az), y_longest = !(ax > ay) & (ay > az);
    return 2 - 2 * x_longest - y_longest;
  }

  HWY_INLINE void begin(Packet& packet) {
    touch_write(meter_, &packet, offsetof(Packet, space), TouchKind::kInHand);
    prepare(packet);
    packet.size = packet.base = 0;
    packet.in_treelet = false;
    cross_top(packet, tables_.instances[0].root_node, packet.alive);
  }

  /// One node or leaf on; false at the end.
  HWY_INLINE bool step(Packet& packet) {
    const F16 f;
    const auto t = hn::Load(f, packet.t);
    while (packet.size > 0 && packet.alive != 0) {
      if (packet.size == packet.base) packet.in_treelet = false, packet.base = 0;
      const PacketEntry& entry = packet.stack[--packet.size];
      touch_read(meter_, &entry, sizeof(PacketEntry), TouchKind::kInHand);
      const uint32_t rays = entry.rays & packet.alive & bits_of(hn::Le(hn::Load(f, entry.near), t));
      if (rays == 0) continue;
      visit(packet, entry.ref, rays);
      prefetch_next(packet);
      return true;
    }
    return false;
  }

  /// What is on top of the stack is looked at when the other packets have had their turn.
  HWY_INLINE void prefetch_next(const Packet& packet) {
    if (packet.size == 0) return;
    const uint32_t ref = packet.stack[packet.size - 1].ref;
    const std::byte* at;
    if (packet.in_treelet && packet.size > packet.base) {
      at = is_leaf(ref) ? packet.leaves + size_t{4} * leaf_offset(ref)
                        : reinterpret_cast<const std::byte*>(packet.nodes + ref);
    } else {
      const uint32_t child = ref & kIndexMask;
      if (kind_of(ref) == ChildKind::kNode) {
        at = reinterpret_cast<const std::byte*>(tables_.nodes + child);
      } else {
        const TreeletEntry& entry = tables_.entries[child];
        const std::byte* page = tables_.pages[entry.treelet];
        if (page == nullptr) return;
        hwy::Prefetch(page);
        touch_ahead(meter_, page, 1, TouchKind::kNodes);
        at = is_leaf(entry.root) ? page : page + sizeof(TreeletHeader) + sizeof(QuantizedNode) * size_t{entry.root};
      }
    }
    for (int line = 0; line < 4; ++line) hwy::Prefetch(at + 64 * line);
    const bool of_treelet = packet.in_treelet && packet.size > packet.base;
    touch_ahead(meter_, at, 4, !of_treelet ? TouchKind::kTopTree : is_leaf(ref) ? TouchKind::kLeaves : TouchKind::kNodes);
  }

  HWY_INLINE void finish(Packet& packet) {
    for (uint32_t i = 0; i < packet.count; ++i) {
      if (HWY_UNLIKELY((packet.extreme >> i & 1) != 0)) {
        stream_.done(*packet.rays[i], trace_slowly(tables_, *packet.rays[i], stream_, counters_));
        continue;
      }
      packet.rays[i]->instance = kNoIndex;
      stream_.done(*packet.rays[i], {packet.node_tests[i], packet.triangle_tests[i], packet.treelets[i]});
    }
  }

  HWY_INLINE void visit(Packet& packet, uint32_t ref, uint32_t rays) {
    if (packet.in_treelet) {
      if (is_leaf(ref)) {
        cross_leaf_told(packet, ref, rays);
      } else {
        cross_node(packet, ref, rays);
      }
      return;
    }
    const uint32_t child = ref & kIndexMask;
    if (kind_of(ref) == ChildKind::kNode) {
      cross_top(packet, child, rays);
      return;
    }
    packet.entry = tables_.entries[child];
    packet.page = page_of(tables_, packet.entry.treelet, stream_);
    if (packet.page == nullptr) return;
    const TreeletView treelet(packet.page);
    touch_read(meter_, &tables_.entries[child], sizeof(TreeletEntry), TouchKind::kTopTree);
    touch_read(meter_, &tables_.pages[packet.entry.treelet], sizeof packet.page, TouchKind::kTopTree);
    touch_read(meter_, &treelet.header->leaves_offset, sizeof(uint32_t), TouchKind::kNodes);
    packet.nodes = treelet.nodes;
    packet.leaves = packet.page + treelet.header->leaves_offset;
    count(packet.treelets, rays, 1);
    packet.in_treelet = true;
    packet.base = packet.size;
    if (is_leaf(packet.entry.root)) {
      cross_leaf_told(packet, packet.entry.root, rays);
    } else {
      cross_node(packet, packet.entry.root, rays);
    }
  }

  HWY_INLINE void cross_leaf_told(Packet& packet, uint32_t ref, uint32_t rays) {
    touch_packet(meter_, packet, rays, kLanes);
    touch_leaf(meter_, LeafView(packet.leaves + size_t{4} * leaf_offset(ref)));
    cross_leaf(packet, ref, rays);
  }

  /// Children of which some of `rays` enter go to the stack, the first to be entered on top.
  template <class Plane>
  HWY_INLINE void push_children(Packet& packet, uint32_t rays, uint32_t count_children, uint32_t there, const Plane& plane,
                                const uint32_t* refs) {
    const F16 f;
    touch_packet(meter_, packet, rays, kLanes);
    use_.node_visits += 1, use_.ray_visits += static_cast<uint64_t>(std::popcount(rays));
    count(packet.node_tests, rays, 1);
    const auto slope_x = hn::Load(f, packet.slope[0]), slope_y = hn::Load(f, packet.slope[1]),
               slope_z = hn::Load(f, packet.slope[2]);
    const auto near_x = hn::Load(f, packet.near_bias[0]), near_y = hn::Load(f, packet.near_bias[1]),
               near_z = hn::Load(f, packet.near_bias[2]);
    const auto far_x = hn::Load(f, packet.far_bias[0]), far_y = hn::Load(f, packet.far_bias[1]),
               far_z = hn::Load(f, packet.far_bias[2]);
    const auto t = hn::Load(f, packet.t), enlarge = hn::Set(f, kFarScale), zero = hn::Zero(f);
    const float *near_0 = plane(packet.negative[0], 0), *near_1 = plane(packet.negative[1], 1),
                *near_2 = plane(packet.negative[2], 2);
    const float *far_0 = plane(packet.negative[0] ^ 1, 0), *far_1 = plane(packet.negative[1] ^ 1, 1),
                *far_2 = plane(packet.negative[2] ^ 1, 2);
    HWY_ALIGN float near[8][kLanes];
    uint32_t enter[8];
    uint32_t entered = 0;
    for (uint32_t slot = 0; slot < count_children; ++slot) {
      const auto t_near =
          hn::Max(hn::Max(hn::MulAdd(hn::Set(f, near_0[slot]), slope_x, near_x),
                          hn::MulAdd(hn::Set(f, near_1[slot]), slope_y, near_y)),
                  hn::Max(hn::MulAdd(hn::Set(f, near_2[slot]), slope_z, near_z), zero));
      const auto t_far = hn::Mul(hn::Min(hn::Min(hn::MulAdd(hn::Set(f, far_0[slot]), slope_x, far_x),
                                                 hn::MulAdd(hn::Set(f, far_1[slot]), slope_y, far_y)),
                                         hn::MulAdd(hn::Set(f, far_2[slot]), slope_z, far_z)),
                                 enlarge);
      hn::Store(t_near, f, near[slot]);
      enter[slot] = rays & bits_of(hn::Le(t_near, hn::Min(t_far, t)));
      entered |= (enter[slot] != 0 ? 1u : 0u) << slot;
    }
    uint32_t keys[8];
    uint32_t size = 0;
    for (entered &= there; entered != 0; entered &= entered - 1) {
      const auto slot = static_cast<uint32_t>(std::countr_zero(entered));
      const uint32_t key = entry_key(near[slot][std::countr_zero(enter[slot])], slot);
      uint32_t i = size++;
      for (; i > 0 && keys[i - 1] < key; --i) keys[i] = keys[i - 1];
      keys[i] = key;
    }
    for (uint32_t i = 0; i < size; ++i) {
      const uint32_t slot = keys[i] & 7;
      PacketEntry& entry = packet.stack[packet.size++];
      touch_write(meter_, &entry, sizeof(PacketEntry), TouchKind::kInHand);
      hn::Store(hn::Load(f, near[slot]), f, entry.near);
      entry.ref = refs[slot];
      entry.rays = enter[slot];
    }
  }

  HWY_INLINE void cross_top(Packet& packet, uint32_t index, uint32_t rays) {
    const TopNode& node = tables_.nodes[index];
    touch_read(meter_, &node, sizeof(TopNode), TouchKind::kTopTree);
    uint32_t refs[8];
    uint32_t children = 0, there = 0;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      refs[slot] = top_ref(node, slot);
      // An instance cannot be here, but in a damaged file.
      const bool used = node.kind[slot] == ChildKind::kNode || node.kind[slot] == ChildKind::kEntry;
      if (used) children = slot + 1, there |= 1u << slot;
    }
    push_children(packet, rays, children, there,
                  [&](uint32_t side, uint32_t axis) { return (side != 0 ? node.hi : node.lo)[axis]; }, refs);
  }

  HWY_INLINE void cross_node(Packet& packet, uint32_t index, uint32_t rays) {
    const QuantizedNode& node = packet.nodes[index];
    touch_read(meter_, &node, sizeof(QuantizedNode), TouchKind::kNodes);
    HWY_ALIGN float planes[6][8];
    const F8 f;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const auto origin = hn::Set(f, node.origin[axis]), step = hn::Set(f, power_of_two(node.exponent[axis]));
      for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
        const auto lo = hn::ConvertTo(f, hn::PromoteTo(I8(), hn::LoadU(B8(), node.lo[axis] + first)));
        const auto hi = hn::ConvertTo(f, hn::PromoteTo(I8(), hn::LoadU(B8(), node.hi[axis] + first)));
        hn::Store(hn::MulAdd(lo, step, origin), f, planes[axis] + first);
        hn::Store(hn::MulAdd(hi, step, origin), f, planes[3 + axis] + first);
      }
    }
    push_children(packet, rays, node.child_count, 0xff,
                  [&](uint32_t side, uint32_t axis) { return planes[3 * side + axis]; }, node.child);
  }

  const SceneTables& tables_;
  PacketState& state_;
  RayStream& stream_;
  TraceCounters& counters_;
  PacketUse& use_;
  [[no_unique_address]] Meter meter_;
};

bool has_packets() { return true; }

HWY_INLINE void count_lanes(const PacketUse& use, TraceCounters& counters) {
  counters.simd_lanes_count += kLeafLanes * use.node_visits, counters.simd_active_lanes_count += use.ray_visits;
}

void trace_packets(const SceneTables& tables, PacketState& state, uint64_t most, RayStream& stream,
                   TraceCounters& counters, PacketUse& use) {
  PacketRun<>(tables, state, stream, counters, use).run(most);
  count_lanes(use, counters);
}

void trace_packets_touching(const SceneTables& tables, PacketState& state, uint64_t most, RayStream& stream,
                            TraceCounters& counters, PacketUse& use, TouchLog& touches) {
  PacketRun<TouchMeter>(tables, state, stream, counters, use, {&touches}).run(most);
  count_lanes(use, counters);
}

#else

bool has_packets() { return false; }

void trace_packets(const SceneTables&, PacketState&, uint64_t, RayStream&, TraceCounters&, PacketUse&) {}
void trace_packets_touching(const SceneTables&, PacketState&, uint64_t, RayStream&, TraceCounters&, PacketUse&,
                            TouchLog&) {}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(has_packets);
HWY_EXPORT(trace_packets);
HWY_EXPORT(trace_packets_touching);

PacketTracer::PacketTracer() : state(std::make_unique<PacketState>()) {}
PacketTracer::~PacketTracer() = default;
uint64_t PacketTracer::bytes() { return sizeof(PacketTracer) + sizeof(PacketState); }

bool PacketTracer::available() { return HWY_DYNAMIC_DISPATCH(has_packets)(); }

PacketUse PacketTracer::trace(const SceneTables& tables, uint64_t most, RayStream& stream, TraceCounters& counters,
                              TouchLog* touches) {
  PacketUse use;
  if (HWY_UNLIKELY(touches != nullptr)) {
    HWY_DYNAMIC_DISPATCH(trace_packets_touching)(tables, *state, most, stream, counters, use, *touches);
    return use;
  }
  HWY_DYNAMIC_DISPATCH(trace_packets)(tables, *state, most, stream, counters, use);
  return use;
}

Ray* PacketTracer::next_waiting() {
  for (WaitingRays& kind : state->waiting) {
    if (kind.count > 0) return kind.rays[--kind.count];
  }
  return nullptr;
}

}  // namespace shoal
#endif
