// Rays through a scene whose treelets are all in memory, each from its start to its end: one stack leads through the
// top tree and the treelets, so that a ray never looks for its place in the top tree again. For orders that hold every
// page; where pages come and go, TopTree::next and trace_treelets. Answers are the same to the bit.
// Called by engine/render_hybrid and bench/against_embree.
//
// Two ways, chosen by what the last rays did (docs/decisions/0018): packets, which test a box for 16 rays at once (8 with AVX2),
// while enough rays enter the same nodes (camera rays, shadow rays, bounces in small scenes), else rays by themselves,
// several in turn.
//
// Properties and assumptions
//   order      rays end in any order and do not affect each other.
//   threads    any number, each with a tracer and a stream of its own.
//   memory     fixed: bytes(), about 1 MiB a tracer, most of it stack that is hardly ever touched.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "treelets/trace_treelet.h"

namespace shoal {

class TouchLog;

/// What one ray took.
struct RayWork {
  uint32_t node_tests = 0, triangle_tests = 0;
  uint32_t treelets = 0;  ///< entered
};

/// Where rays come from and go to.
class RayStream {
 public:
  virtual ~RayStream() = default;
  /// The next ray, as it was begun (no cursor, no instance), which stays where it is until done(); nullptr: there is
  /// none for now. Asked again as long as rays are under way, so one may be there after a done().
  /// Up to 24 x 15 rays wait for others of their kind beside 4 x 16 under way: have at least 500 out at once.
  virtual Ray* next() = 0;
  /// The answer of `ray` is known.
  virtual void done(Ray& ray, const RayWork& work) = 0;
  /// Reads a page that the table does not have, keeps it until the trace ends, and enters it in the table. nullptr: it
  /// failed; rays go on without that treelet, so that answers are wrong and the picture must be dropped.
  virtual const std::byte* bring(TreeletId treelet) = 0;
};

/// Decoded geometry pages by treelet, with bytes behind them as trace_treelets() requires; nullptr: not in memory yet.
using PageTable = const std::byte* const*;

/// kPackets: where they can be. Not with instances (a packet needs one space), nor on processors without vectors of 256
/// bits, nor by another TriangleTest than the default; there rays go single.
enum class RayGrouping { kAuto, kPackets, kSingle };

class SceneTracer {
 public:
  /// Keeps a reference to the tree and the table.
  SceneTracer(const TopTree& tree, PageTable pages, RayGrouping grouping = RayGrouping::kAuto,
              TriangleTest test = TriangleTest::kWatertight);
  ~SceneTracer();
  /// Of a tracer.
  static uint64_t bytes();
  /// Until the stream has no ray left and none is under way. `touches`: told what is touched, when somebody measures
  /// (treelets/trace_touching.h).
  void trace(RayStream& stream, TraceCounters& counters, TouchLog* touches = nullptr);

 private:
  bool use_packets() const;

  const TopTree& tree_;
  PageTable pages_;
  RayGrouping grouping_;
  TriangleTest test_;
  bool slow_;                ///< the top tree is too deep or too large for the kernels: every ray goes the slow way
  bool in_packets_ = true;   ///< what the last rays did better in
  std::unique_ptr<struct LaneTracer> lanes_;
  std::unique_ptr<struct PacketTracer> packets_;
};

}  // namespace shoal
