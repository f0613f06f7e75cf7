#include "bench/wide_bvh.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <time.h>

#include <algorithm>
#include <vector>

#include "engine/clock.h"
#include "treelets/collapse_wide.h"

namespace shoal::bench {
namespace {

constexpr uint32_t kSerialCount = 8192;  // references below which our nodes are written by one task
constexpr size_t kArenaBytes = 1u << 20;

class Stopwatch {
 public:
  Spent spent() const { return {now_seconds() - start_, process_cpu_seconds() - cpu_start_}; }

 private:
  double start_ = now_seconds(), cpu_start_ = process_cpu_seconds();
};

// What Embree calls for each node and leaf.
void* create_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  return rtcThreadLocalAlloc(allocator, sizeof(WideNode), 16);
}

void set_children(void* node, void** children, unsigned count, void*) {
  auto* wide = static_cast<WideNode*>(node);
  wide->count = count;
  for (unsigned i = 0; i < count; ++i) wide->child[i] = reinterpret_cast<uintptr_t>(children[i]);
}

void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  auto* wide = static_cast<WideNode*>(node);
  for (unsigned i = 0; i < count; ++i) {
    const RTCBounds& b = *bounds[i];
    wide->lo[i][0] = b.lower_x, wide->lo[i][1] = b.lower_y, wide->lo[i][2] = b.lower_z;
    wide->hi[i][0] = b.upper_x, wide->hi[i][1] = b.upper_y, wide->hi[i][2] = b.upper_z;
  }
}

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, size_t count, void*) {
  auto* leaf = static_cast<WideLeaf*>(rtcThreadLocalAlloc(allocator, 4 * (count + 1), 16));
  leaf->count = static_cast<uint32_t>(count);
  for (size_t i = 0; i < count; ++i) leaf->id[i] = primitives[i].primID;
  return reinterpret_cast<void*>(reinterpret_cast<uintptr_t>(leaf) | 1);
}

void add_cost(uintptr_t child, const float lo[3], const float hi[3], uint32_t block, WideCost& cost) {
  const double area = half_area(lo, hi);
  if (WideNode::is_leaf(child)) {
    const uint32_t count = WideNode::leaf(child).count;
    cost.tests += area * ((count + block - 1) / block);
    ++cost.leaves_count;
    cost.triangles_count += count;
    return;
  }
  cost.tests += area;
  ++cost.nodes_count;
  const WideNode& node = *reinterpret_cast<const WideNode*>(child);
  for (uint32_t i = 0; i < node.count; ++i) add_cost(node.child[i], node.lo[i], node.hi[i], block, cost);
}

}  // namespace

WideCost measure_cost(uintptr_t root, uint32_t block) {
  WideCost cost;
  if (WideNode::is_leaf(root)) return {0, 0, 1, WideNode::leaf(root).count};
  const WideNode& node = *reinterpret_cast<const WideNode*>(root);
  float lo[3], hi[3];
  for (int axis = 0; axis < 3; ++axis) {
    lo[axis] = node.lo[0][axis], hi[axis] = node.hi[0][axis];
    for (uint32_t i = 1; i < node.count; ++i) {
      lo[axis] = std::min(lo[axis], node.lo[i][axis]), hi[axis] = std::max(hi[axis], node.hi[i][axis]);
    }
  }
  add_cost(root, lo, hi, block, cost);
  const double area = half_area(lo, hi);
  cost.tests = area > 0 ? cost.tests / area : 0;
  return cost;
}

HugeArray<RTCBuildPrimitive> primitives_of(std::span<const BuildRef> refs) {
  HugeArray<RTCBuildPrimitive> primitives(refs.size());
  tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) {
    const BuildRef& r = refs[i];
    primitives[i] = {r.lo[0], r.lo[1], r.lo[2], 0, r.hi[0], r.hi[1], r.hi[2], r.id};
  });
  return primitives;
}

EmbreeBvh::EmbreeBvh(RTCDevice device, HugeArray<RTCBuildPrimitive> primitives, size_t count,
                     const SahSettings& settings)
    : bvh_(rtcNewBVH(device)) {
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.byteSize = sizeof(arguments);
  arguments.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
  arguments.maxBranchingFactor = 8;
  arguments.sahBlockSize = settings.block;
  arguments.minLeafSize = 1, arguments.maxLeafSize = settings.leaf_size;
  arguments.traversalCost = 1, arguments.intersectionCost = 1;
  arguments.bvh = bvh_;
  arguments.primitives = primitives.data();
  arguments.primitiveCount = arguments.primitiveArrayCapacity = count;
  arguments.createNode = create_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  arguments.createLeaf = create_leaf;
  const Stopwatch watch;
  root_ = reinterpret_cast<uintptr_t>(rtcBuildBVH(&arguments));
  spent_ = watch.spent();
}

EmbreeBvh::~EmbreeBvh() { rtcReleaseBVH(bvh_); }

// Memory that each thread fills from its own front.
class OurBvh::Arenas {
 public:
  void* take(size_t bytes) {
    Arena& arena = arenas_.local();
    bytes = (bytes + 15) & ~size_t{15};
    if (arena.left < bytes) {
      arena.blocks.push_back(std::make_unique_for_overwrite<std::byte[]>(kArenaBytes));
      arena.next = arena.blocks.back().get(), arena.left = kArenaBytes;
    }
    void* memory = arena.next;
    arena.next += bytes, arena.left -= bytes;
    return memory;
  }

  uintptr_t store(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const BuildRef> refs,
                  uint32_t root) {
    const BinaryNode& binary = tree[root];
    if (binary.leaf()) {
      auto* leaf = static_cast<WideLeaf*>(take(4 * (binary.count + 1)));
      leaf->count = binary.count;
      for (uint32_t i = 0; i < binary.count; ++i) leaf->id[i] = refs[binary.first + i].id;
      return reinterpret_cast<uintptr_t>(leaf) | 1;
    }
    auto* node = static_cast<WideNode*>(take(sizeof(WideNode)));
    const WideChildren children = plan.children(root);
    node->count = children.count;
    for (uint32_t i = 0; i < children.count; ++i) {
      const BinaryNode& child = tree[children.node[i]];
      std::copy_n(child.lo, 3, node->lo[i]), std::copy_n(child.hi, 3, node->hi[i]);
    }
    const auto store_child = [&](uint32_t i) { node->child[i] = store(tree, plan, refs, children.node[i]); };
    if (binary.count > kSerialCount) {
      tbb::parallel_for(0u, children.count, store_child);
    } else {
      for (uint32_t i = 0; i < children.count; ++i) store_child(i);
    }
    return reinterpret_cast<uintptr_t>(node);
  }

 private:
  struct Arena {
    std::vector<std::unique_ptr<std::byte[]>> blocks;
    std::byte* next = nullptr;
    size_t left = 0;
  };
  tbb::enumerable_thread_specific<Arena> arenas_;
};

OurBvh::OurBvh(RefArray refs, const SahModel& model) : arenas_(std::make_unique<Arenas>()) {
  const Stopwatch watch;
  {
    const std::vector<BinaryNode> tree = build_binary_tree(refs.refs(), model);
    tree_seconds_ = watch.spent().seconds;
    const WidePlan plan(tree);
    plan_seconds_ = watch.spent().seconds - tree_seconds_;
    root_ = arenas_->store(tree, plan, refs.refs(), 0);
  }
  spent_ = watch.spent();  // binary tree and plan given back, as Embree does with what it needs meanwhile
  store_seconds_ = spent_.seconds - plan_seconds_ - tree_seconds_;
}

OurBvh::~OurBvh() = default;

}  // namespace shoal::bench
