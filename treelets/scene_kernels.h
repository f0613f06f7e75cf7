// The two kernels behind treelets/trace_scene: single rays in lanes (trace_scene_lanes.cpp) and packets
// (trace_scene_packets.cpp). What they share: the tables of a scene, references on the stack, and the slow way.
#pragma once

#include "treelets/trace_scene.h"
#include "treelets/treelet_layout.h"

namespace shoal {

/// A scene as the kernels see it.
struct SceneTables {
  const TopTree* tree;
  const TopNode* nodes;
  const TreeletEntry* entries;
  const Instance* instances;
  PageTable pages;
  TriangleTest test;
};

/// Levels of the top tree, instances and object together, that the stacks have room for.
inline constexpr uint32_t kMaxTopDepth = 96;
/// At each level at most 7 siblings wait; 8 are written whatever the number.
inline constexpr uint32_t kSceneStack = 7 * (kMaxTreeletDepth + kMaxTopDepth) + 8;

/// A child of a TopNode on a stack: its ChildKind above its index.
inline constexpr uint32_t kKindShift = 30, kIndexMask = (1u << kKindShift) - 1;
inline constexpr uint32_t top_ref(const TopNode& node, uint32_t slot) {
  return node.child[slot] | static_cast<uint32_t>(node.kind[slot]) << kKindShift;
}
inline constexpr ChildKind kind_of(uint32_t ref) { return static_cast<ChildKind>(ref >> kKindShift); }

/// A top tree too deep or too large for the stacks: every ray goes the slow way.
bool exceeds_stacks(const TopTree& tree);
/// A scene's tables. Keeps references.
SceneTables scene_tables(const TopTree& tree, PageTable pages, TriangleTest test);

/// The page of a treelet, brought if need be; nullptr: it cannot be had.
inline const std::byte* page_of(const SceneTables& tables, TreeletId treelet, RayStream& stream) {
  const std::byte* page = tables.pages[treelet];
  return page != nullptr ? page : stream.bring(treelet);
}

/// Any ray, from its start but with the hit it has: slowly, by TopTree::next and trace_treelet. For rays whose numbers
/// are too extreme for the kernels.
RayWork trace_slowly(const SceneTables& tables, Ray& ray, RayStream& stream, TraceCounters& counters);
/// Every ray of the stream; of an empty scene, each is a miss.
void trace_all_slowly(const SceneTables& tables, RayStream& stream, TraceCounters& counters);

struct LaneTracer {
  LaneTracer();
  ~LaneTracer();
  static uint64_t bytes();
  /// Starts `most` rays of the stream, fewer if it ends, and traces them. Returns how many.
  /// Requires, as PacketTracer: a top tree of at most kMaxTopDepth levels.
  uint64_t trace(const SceneTables& tables, uint64_t most, RayStream& stream, TraceCounters& counters,
                 TouchLog* touches = nullptr);

  std::unique_ptr<struct SceneLanes> lanes;
};

/// How well packets are used.
struct PacketUse {
  uint64_t packets = 0;
  uint64_t node_visits = 0;  ///< of packets
  uint64_t ray_visits = 0;   ///< of rays: those of a packet that entered the node
};

struct PacketTracer {
  PacketTracer();
  ~PacketTracer();
  static uint64_t bytes();
  /// Whether this processor has a kernel for packets.
  static bool available();
  /// Traces `most` full packets of the stream. When it ends before, also the rays that are left over; else those wait
  /// for the next call, or for next_waiting(). Requires: available(), that the tree is of a single_identity(), and
  /// TriangleTest::kWatertight.
  PacketUse trace(const SceneTables& tables, uint64_t most, RayStream& stream, TraceCounters& counters,
                  TouchLog* touches = nullptr);
  /// Takes a ray back that waits for a packet; nullptr: none does.
  Ray* next_waiting();

  std::unique_ptr<struct PacketState> state;
};

}  // namespace shoal
