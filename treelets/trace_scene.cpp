#include "treelets/trace_scene.h"

#include <algorithm>

#include "treelets/ray_space.h"
#include "treelets/scene_kernels.h"

namespace shoal {
namespace {

/// Packets are worth it where a node that a packet visits is entered by so many of its rays. On the terrain of 10 M
/// triangles diffuse rays have 2.1 and are a third slower in packets, in the kitchen 4.0 and are 40 % faster.
constexpr double kLeastRaysAVisit = 3;
/// So many packets say whether packets are worth it; then so many single rays until it is tried again.
constexpr uint64_t kPacketsATrial = 64, kRaysBetweenTrials = 32768;

/// Serves what waits for a packet first.
class WithWaiting final : public RayStream {
 public:
  WithWaiting(RayStream& stream, PacketTracer& packets) : stream_(stream), packets_(packets) {}
  Ray* next() override {
    Ray* waiting = packets_.next_waiting();
    return waiting != nullptr ? waiting : stream_.next();
  }
  void done(Ray& ray, const RayWork& work) override { stream_.done(ray, work); }
  const std::byte* bring(TreeletId treelet) override { return stream_.bring(treelet); }

 private:
  RayStream& stream_;
  PacketTracer& packets_;
};

}  // namespace

bool exceeds_stacks(const TopTree& tree) {
  uint32_t deepest = 0;
  for (const TopNode& node : tree.nodes()) deepest = std::max(deepest, node.level);
  const size_t most = std::max({tree.nodes().size(), tree.entries().size(), size_t{tree.instance_count()}});
  return 2 * (deepest + 1) > kMaxTopDepth || most > kIndexMask;  // of the tree over instances and of an object
}

SceneTables scene_tables(const TopTree& tree, PageTable pages, TriangleTest test) {
  return {&tree, tree.nodes().data(), tree.entries().data(), tree.instances().data(), pages, test};
}

RayWork trace_slowly(const SceneTables& tables, Ray& ray, RayStream& stream, TraceCounters& counters) {
  RayContext context;
  TraceCounters tests;
  RayWork work;
  ray.cursor = kNoIndex, ray.instance = kNoIndex, ray.more = 0;
  while (!(ray.any_hit() && ray.hit.valid())) {
    const uint32_t index = tables.tree->next(ray, context, tests.node_tests_count);
    if (index == kNoIndex) break;
    const TreeletEntry& entry = tables.entries[index];
    const std::byte* page = page_of(tables, entry.treelet, stream);
    if (page == nullptr) continue;
    TraceJob job{page, &ray, &context, &tables.instances[ray.instance], entry};
    trace_treelets({&job, 1}, tests, tables.test);
    ++work.treelets;
  }
  ray.cursor = kNoIndex, ray.instance = kNoIndex, ray.more = 0;
  counters.coverage_tests_count += tests.coverage_tests_count;
  work.node_tests = static_cast<uint32_t>(tests.node_tests_count);
  work.triangle_tests = static_cast<uint32_t>(tests.triangle_tests_count);
  return work;
}

void trace_all_slowly(const SceneTables& tables, RayStream& stream, TraceCounters& counters) {
  const bool empty = tables.tree->nodes().empty();
  while (Ray* ray = stream.next()) stream.done(*ray, empty ? RayWork() : trace_slowly(tables, *ray, stream, counters));
}

SceneTracer::SceneTracer(const TopTree& tree, PageTable pages, RayGrouping grouping, TriangleTest test)
    : tree_(tree),
      pages_(pages),
      grouping_(grouping),
      test_(test),
      slow_(exceeds_stacks(tree)),
      lanes_(std::make_unique<LaneTracer>()),
      packets_(std::make_unique<PacketTracer>()) {}

SceneTracer::~SceneTracer() = default;

uint64_t SceneTracer::bytes() { return sizeof(SceneTracer) + LaneTracer::bytes() + PacketTracer::bytes(); }

/// Packets need all rays in one space, and have the default's triangle test only.
bool SceneTracer::use_packets() const {
  return test_ == TriangleTest::kWatertight && grouping_ != RayGrouping::kSingle && PacketTracer::available() && tree_.single_identity();
}

void SceneTracer::trace(RayStream& stream, TraceCounters& counters, TouchLog* touches) {
  const SceneTables tables = scene_tables(tree_, pages_, test_);
  if (slow_ || tree_.nodes().empty()) return trace_all_slowly(tables, stream, counters);
  if (!use_packets()) {
    lanes_->trace(tables, ~uint64_t{0}, stream, counters, touches);
    return;
  }
  WithWaiting single(stream, *packets_);
  for (;;) {
    if (in_packets_) {
      const PacketUse use = packets_->trace(tables, kPacketsATrial, stream, counters, touches);
      if (use.packets < kPacketsATrial) return;
      const double rays = static_cast<double>(use.ray_visits), visits = static_cast<double>(use.node_visits);
      in_packets_ = grouping_ == RayGrouping::kPackets || rays >= kLeastRaysAVisit * visits;
    } else {
      if (lanes_->trace(tables, kRaysBetweenTrials, single, counters, touches) < kRaysBetweenTrials) return;
      in_packets_ = true;
    }
  }
}

}  // namespace shoal
