// The triangles of an object in the order of its source, in blocks: decoded in parallel, handed over in order, never
// held whole. Called by engine/build_scene and engine/build_chunks. Memory: a lane each block in flight.
// Thread rule: prepare() runs on many threads at once, one block each; take() and source_done() one call at a time.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "engine/plan_objects.h"
#include "engine/position_grid.h"
#include "engine/read_mesh.h"

namespace shoal {

inline constexpr uint64_t kBlockTriangles = 16384;

struct StreamBlock {
  TriangleBlock triangles;
  uint64_t read_count = 0;          ///< triangles of the source that it stands for, degenerate ones too
  std::vector<uint32_t> tags;       ///< for prepare() to leave something to take(), one a triangle
  std::vector<std::byte> records;   ///< likewise
  Bounds3 centroids, corners;       ///< likewise
};

class BlockTaker {
 public:
  virtual ~BlockTaker() = default;
  /// Work on one block that no order matters to.
  virtual void prepare(StreamBlock& block) const { (void)block; }
  /// In the order of the source.
  virtual Status take(StreamBlock& block) = 0;
  /// All blocks of this primitive were taken.
  virtual Status source_done(const PrimitiveSource& source) {
    (void)source;
    return {};
  }
};

/// Something that gives its triangles again and again, always the same ones in the same order.
class TriangleSource {
 public:
  virtual ~TriangleSource() = default;
  /// `with_corners`: their attributes too, else positions, primitives and materials. Fails with: kInput, kStorage,
  /// kStopped, and what the taker returns.
  virtual Status stream(bool with_corners, BlockTaker& taker) = 0;
};

/// What every object of a scene is read with.
struct StreamInput {
  FileSystem& fs;
  const gltf::Document& document;
  const FlatScene& flat;
  const GeometryPlan& geometry;
  const MaterialPlan& materials;
  const std::atomic<bool>* stop;
  uint32_t lanes;  ///< blocks in flight
};

class ObjectSource : public TriangleSource {
 public:
  ObjectSource(const StreamInput& input, const ObjectPlan& object, CornerLayout layout)
      : input_(input), object_(object), layout_(layout) {}
  Status stream(bool with_corners, BlockTaker& taker) override;
  /// From now on corners are rounded to the grid as they are read.
  void round_to(const PositionGrid& grid) { grid_ = grid; }
  uint64_t read_bytes() const { return read_bytes_; }
  const CornerLayout& layout() const { return layout_; }

  /// Memory of one lane at most.
  static uint64_t lane_bytes(CornerLayout layout, uint32_t pose_windows);

 private:
  const StreamInput& input_;
  const ObjectPlan& object_;
  CornerLayout layout_;
  PositionGrid grid_;
  uint64_t read_bytes_ = 0;
};

/// kStopped when `stop` says so.
Status check_stop(const std::atomic<bool>* stop, const std::string& path);

}  // namespace shoal
