#include "engine/stream_object.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>

#include <atomic>
#include <memory>
#include <mutex>

#include "engine/chunk_records.h"

namespace shoal {

namespace {

constexpr size_t kOpenFilesPerLane = 16;

/// What decodes one block at a time, and the block.
struct Lane {
  Lane(FileSystem& fs, const gltf::Document& document) : files(fs, document, kOpenFilesPerLane) {}
  gltf::BufferFiles files;
  const PrimitiveSource* open_source = nullptr;
  std::optional<PrimitiveReader> reader;
  StreamBlock block;
  Status status;
  const PrimitiveSource* source = nullptr;
  uint64_t first = 0, count = 0;
  bool last_of_source = false;
};

class ObjectStream {
 public:
  ObjectStream(const StreamInput& input, const ObjectPlan& object, CornerLayout layout, const PositionGrid& grid,
               BlockTaker& taker)
      : input_(input), object_(object), layout_(layout), grid_(grid), taker_(taker) {
    for (const uint32_t m : object.meshes) {
      for (const PrimitiveSource& source : input.geometry.meshes[m].primitives) sources_.push_back(&source);
    }
    for (uint32_t i = 0; i < std::max(1u, input.lanes); ++i) {
      lanes_.push_back(std::make_unique<Lane>(input.fs, input.document));
      free_.push_back(lanes_.back().get());
    }
  }

  Status run() {
    const auto assign = tbb::make_filter<void, Lane*>(
        tbb::filter_mode::serial_in_order, [this](tbb::flow_control& control) -> Lane* { return next(control); });
    const auto decode = tbb::make_filter<Lane*, Lane*>(tbb::filter_mode::parallel, [this](Lane* lane) {
      lane->status = decode_block(*lane);
      if (!lane->status.ok()) failed_ = true;
      return lane;
    });
    const auto take = tbb::make_filter<Lane*, void>(tbb::filter_mode::serial_in_order, [this](Lane* lane) {
      if (status_.ok()) status_ = take_block(*lane);
      if (!status_.ok()) failed_ = true;
      const std::lock_guard lock(mutex_);
      free_.push_back(lane);
    });
    tbb::parallel_pipeline(lanes_.size(), assign & decode & take);
    return std::move(status_);
  }

  uint64_t read_bytes() const {
    uint64_t bytes = 0;
    for (const auto& lane : lanes_) bytes += lane->files.read_bytes();
    return bytes;
  }

 private:
  Lane* next(tbb::flow_control& control) {
    while (source_ < sources_.size() && sources_[source_]->triangle_count == 0) ++source_;
    if (source_ == sources_.size() || failed_) return control.stop(), nullptr;
    Lane* lane = nullptr;
    {
      const std::lock_guard lock(mutex_);
      SHOAL_CHECK(!free_.empty());  // as many lanes as blocks in flight
      lane = free_.back();
      free_.pop_back();
    }
    const PrimitiveSource& source = *sources_[source_];
    lane->source = &source;
    lane->first = next_;
    lane->count = std::min(kBlockTriangles, source.triangle_count - next_);
    next_ += lane->count;
    lane->last_of_source = next_ == source.triangle_count;
    if (lane->last_of_source) ++source_, next_ = 0;
    return lane;
  }

  Status decode_block(Lane& lane) {
    SHOAL_RETURN_IF_ERROR(check_stop(input_.stop, input_.document.path));
    if (lane.open_source != lane.source) {
      lane.reader.reset();
      lane.open_source = nullptr;
      const PlacedItem& placed = input_.flat.meshes[input_.geometry.meshes[lane.source->mesh].placements[0]];
      SHOAL_ASSIGN_OR_RETURN(lane.reader,
                             PrimitiveReader::open(lane.files, input_.document, input_.materials, *lane.source,
                                                   layout_, object_.baked ? &placed.to_world : nullptr));
      lane.open_source = lane.source;
    }
    SHOAL_RETURN_IF_ERROR(lane.reader->read(lane.first, lane.count, lane.block.triangles));
    grid_.round(lane.block.triangles.soup.positions);
    lane.block.read_count = lane.count;
    taker_.prepare(lane.block);
    return {};
  }

  Status take_block(Lane& lane) {
    SHOAL_RETURN_IF_ERROR(std::move(lane.status));
    SHOAL_RETURN_IF_ERROR(taker_.take(lane.block));
    return lane.last_of_source ? taker_.source_done(*lane.source) : Status();
  }

  const StreamInput& input_;
  const ObjectPlan& object_;
  const CornerLayout layout_;
  const PositionGrid grid_;
  BlockTaker& taker_;
  std::vector<const PrimitiveSource*> sources_;
  size_t source_ = 0;  // the next block
  uint64_t next_ = 0;
  std::vector<std::unique_ptr<Lane>> lanes_;
  std::vector<Lane*> free_;
  std::mutex mutex_;
  std::atomic<bool> failed_ = false;
  Status status_;
};

}  // namespace

Status ObjectSource::stream(bool with_corners, BlockTaker& taker) {
  ObjectStream stream(input_, object_, with_corners ? layout_ : CornerLayout{}, grid_, taker);
  const Status status = stream.run();
  read_bytes_ += stream.read_bytes();
  return status;
}

uint64_t ObjectSource::lane_bytes(CornerLayout layout, uint32_t pose_windows) {
  const uint64_t soup = 36 + 8 + 12ull * layout.floats();
  return PrimitiveReader::memory_bytes(layout, pose_windows) + kBlockTriangles * (soup + 4 + record_bytes(layout)) + (64u << 10);
}

Status check_stop(const std::atomic<bool>* stop, const std::string& path) {
  if (stop == nullptr || !stop->load(std::memory_order_relaxed)) return {};
  return Error{ErrorCode::kStopped, fmt::format("{}: the build was stopped before it was complete", path)};
}

}  // namespace shoal
