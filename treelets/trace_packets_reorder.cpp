// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_packets_reorder.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/packet_traversal.h"
#include "treelets/packet_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

/// Packets that shrink (Boulos, Wald & Benthin 2008, "Adaptive Ray Packet Reordering"): where at most half of
/// the lanes of the rows in use hold a ray that enters a node, its rays are copied into full rows and go on there
/// by themselves. They went by a threshold of a half too, for rows of 4.
struct ReorderedPackets {
  static constexpr bool kFirstRowSuffices = false;
  static bool reorders(uint32_t rays, int rows) { return 2 * rays <= kRowRays * static_cast<uint32_t>(rows); }
};

void reordered_packets_watertight(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays,
                                  RayStream& stream, TraceCounters& counters) {
  PacketWalk<TriangleTest::kWatertight, ReorderedPackets>(tables, state, stream, counters).run(packet_rays);
}
void reordered_packets_fast(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays,
                            RayStream& stream, TraceCounters& counters) {
  PacketWalk<TriangleTest::kFast, ReorderedPackets>(tables, state, stream, counters).run(packet_rays);
}
void reordered_packets_double(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays,
                              RayStream& stream, TraceCounters& counters) {
  PacketWalk<TriangleTest::kDouble, ReorderedPackets>(tables, state, stream, counters).run(packet_rays);
}
void reordered_packets_touching(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays,
                                RayStream& stream, TraceCounters& counters, TouchLog& log) {
  PacketWalk<TriangleTest::kWatertight, ReorderedPackets, TouchMeter>(tables, state, stream, counters, {&log})
      .run(packet_rays);
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(reordered_packets_watertight);
HWY_EXPORT(reordered_packets_fast);
HWY_EXPORT(reordered_packets_double);
HWY_EXPORT(reordered_packets_touching);

std::unique_ptr<SceneTraversal> make_reordering_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                          uint32_t packet_rays, TouchLog* touches) {
  const auto walk = [](const SceneTables& tables, PacketWalkState& state, uint32_t rays, RayStream& stream,
                       TraceCounters& counters, TouchLog* log) {
    switch (tables.test) {
      case TriangleTest::kFast:
        return HWY_DYNAMIC_DISPATCH(reordered_packets_fast)(tables, state, rays, stream, counters);
      case TriangleTest::kDouble:
        return HWY_DYNAMIC_DISPATCH(reordered_packets_double)(tables, state, rays, stream, counters);
      case TriangleTest::kWatertight:
        if (HWY_UNLIKELY(log != nullptr)) {
          return HWY_DYNAMIC_DISPATCH(reordered_packets_touching)(tables, state, rays, stream, counters, *log);
        }
        return HWY_DYNAMIC_DISPATCH(reordered_packets_watertight)(tables, state, rays, stream, counters);
    }
  };
  return std::make_unique<PacketTraversal>(tree, pages, test, packet_rays, walk, touches);
}

}  // namespace shoal
#endif
