// What a thread touches of memory while it brings rays through a scene: address, size and kind, in the order in which it
// happens, handed on in pieces (to a model of the caches: engine/touch_recorder). The kernels take a meter as template
// parameter: with NoTouches every call is empty and nothing of it is compiled in, with TouchMeter it goes to a log.
//
// Properties and assumptions
//   order      that of the thread; what another thread does lies between at any place.
//   threads    one log a thread.
//   memory     16 KiB a log. Cost: some 2 ns a touch beside what the sink does.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace shoal {

// X(enumerator, name, sentence)
#define SHOAL_TOUCH_KINDS(X)                                                                     \
  X(kTopTree, "top_tree", "nodes of the top tree, entries, instances")                           \
  X(kNodes, "treelet_nodes", "headers and nodes of treelets")                                    \
  X(kLeaves, "treelet_leaves", "leaves of treelets")                                             \
  X(kGivenRays, "given_rays", "rays as they are given; benches only")                            \
  X(kAnswers, "answers", "answers as they are handed back; benches only")                        \
  X(kQueues, "rays", "rays that wait: blocks of queues, slots of waves, the orders' own")        \
  X(kSorting, "sorting", "keys and permutations of the sorted order")                            \
  X(kInHand, "in_hand", "rays being traced: themselves, their contexts, lanes, jobs and stacks") \
  X(kPathStates, "path_states", "path states")                                                   \
  X(kPages, "decoded_pages", "pages written by the thread that decodes them")

enum class TouchKind : uint8_t {
#define SHOAL_DECLARE(enumerator, name, sentence) enumerator,
  SHOAL_TOUCH_KINDS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};
inline constexpr const char* kTouchKindNames[] = {
#define SHOAL_DECLARE(enumerator, name, sentence) name,
    SHOAL_TOUCH_KINDS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};
inline constexpr uint8_t kTouchKindCount = std::size(kTouchKindNames);

enum class TouchAction : uint8_t { kRead, kWrite, kPrefetch };

struct Touch {
  uint64_t address;
  uint32_t bytes;
  TouchKind kind;
  TouchAction action;
};
static_assert(sizeof(Touch) == 16);

/// Lanes of a vector operation that had something to do, of those that there were.
struct LaneUse {
  uint64_t active = 0, offered = 0;

  void add(uint32_t used, uint32_t lanes) { active += used, offered += lanes; }
  void add(const LaneUse& other) { active += other.active, offered += other.offered; }
  double share() const { return offered == 0 ? 0.0 : static_cast<double>(active) / static_cast<double>(offered); }
};

/// By what is tested: children of 8-wide nodes (in packets: rays), triangles of leaves (in packets: rays).
struct LaneUses {
  LaneUse top_nodes, nodes, leaves, packets;

  void add(const LaneUses& other) {
    top_nodes.add(other.top_nodes), nodes.add(other.nodes);
    leaves.add(other.leaves), packets.add(other.packets);
  }
};

class TouchSink {
 public:
  virtual ~TouchSink() = default;
  virtual void take(std::span<const Touch> touches) = 0;
};

class TouchLog {
 public:
  /// Keeps a reference. Whoever made it calls flush() at the end.
  explicit TouchLog(TouchSink& sink) : sink_(sink) {}
  TouchLog(const TouchLog&) = delete;
  TouchLog& operator=(const TouchLog&) = delete;

  void read(const void* at, size_t bytes, TouchKind kind) { add(at, bytes, kind, TouchAction::kRead); }
  void write(const void* at, size_t bytes, TouchKind kind) { add(at, bytes, kind, TouchAction::kWrite); }
  template <class T>
  void read(const T& value, TouchKind kind) {
    read(&value, sizeof(T), kind);
  }
  template <class T>
  void write(const T& value, TouchKind kind) {
    write(&value, sizeof(T), kind);
  }
  /// The line that `at` lies in was asked for ahead of time.
  void prefetch(const void* at, TouchKind kind) { add(at, 1, kind, TouchAction::kPrefetch); }
  void flush() {
    sink_.take({touches_.data(), count_});
    count_ = 0;
  }

  void add(const void* at, size_t bytes, TouchKind kind, TouchAction action) {
    if (count_ == touches_.size()) flush();
    touches_[count_++] = {reinterpret_cast<uintptr_t>(at), static_cast<uint32_t>(bytes), kind, action};
  }

  LaneUses lanes;

 private:
  TouchSink& sink_;
  size_t count_ = 0;
  std::array<Touch, 1024> touches_;
};

/// Of kernels that nobody measures.
struct NoTouches {
  static constexpr bool kMeters = false;
};

/// Of kernels that tell a log.
struct TouchMeter {
  static constexpr bool kMeters = true;
  TouchLog* log;
};

}  // namespace shoal
