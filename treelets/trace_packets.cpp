// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_packets.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/packet_traversal.h"
#include "treelets/packet_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

/// Packets as they are (Wald et al. 2001), entered by the first row that may enter.
struct PlainPackets {
  static constexpr bool kFirstRowSuffices = true;
  static bool reorders(uint32_t, int) { return false; }
};

void packets_watertight(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays, RayStream& stream,
                        TraceCounters& counters) {
  PacketWalk<TriangleTest::kWatertight, PlainPackets>(tables, state, stream, counters).run(packet_rays);
}
void packets_fast(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays, RayStream& stream,
                  TraceCounters& counters) {
  PacketWalk<TriangleTest::kFast, PlainPackets>(tables, state, stream, counters).run(packet_rays);
}
void packets_double(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays, RayStream& stream,
                    TraceCounters& counters) {
  PacketWalk<TriangleTest::kDouble, PlainPackets>(tables, state, stream, counters).run(packet_rays);
}
void packets_touching(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays, RayStream& stream,
                      TraceCounters& counters, TouchLog& log) {
  PacketWalk<TriangleTest::kWatertight, PlainPackets, TouchMeter>(tables, state, stream, counters, {&log})
      .run(packet_rays);
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(packets_watertight);
HWY_EXPORT(packets_fast);
HWY_EXPORT(packets_double);
HWY_EXPORT(packets_touching);

std::unique_ptr<SceneTraversal> make_packet_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                      uint32_t packet_rays, TouchLog* touches) {
  const auto walk = [](const SceneTables& tables, PacketWalkState& state, uint32_t rays, RayStream& stream,
                       TraceCounters& counters, TouchLog* log) {
    switch (tables.test) {
      case TriangleTest::kFast:
        return HWY_DYNAMIC_DISPATCH(packets_fast)(tables, state, rays, stream, counters);
      case TriangleTest::kDouble:
        return HWY_DYNAMIC_DISPATCH(packets_double)(tables, state, rays, stream, counters);
      case TriangleTest::kWatertight:
        if (HWY_UNLIKELY(log != nullptr)) {
          return HWY_DYNAMIC_DISPATCH(packets_touching)(tables, state, rays, stream, counters, *log);
        }
        return HWY_DYNAMIC_DISPATCH(packets_watertight)(tables, state, rays, stream, counters);
    }
  };
  return std::make_unique<PacketTraversal>(tree, pages, test, packet_rays, walk, touches);
}

}  // namespace shoal
#endif
