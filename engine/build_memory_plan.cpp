#include "engine/build_memory_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "engine/chunk_records.h"
#include "engine/place_instances.h"
#include "engine/read_mesh.h"
#include "engine/stream_object.h"
#include "io/glb.h"
#include "io/write_behind.h"
#include "treelets/build_forest.h"
#include "treelets/chunk_grid.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
/// Program, libraries, stacks of the threads and what the allocator keeps: 13 MiB were seen.
constexpr uint64_t kProcessBytes = 16 * kMiB;
/// Of a thread: its stack, its part of the allocator, and its staging of direct reads that are not aligned (256 KiB).
constexpr uint64_t kThreadBytes = kMiB * 3 / 4;
/// What a tree can be built of at once: its indices have 32 bits, and a binary tree has two nodes a triangle.
constexpr uint64_t kMaxChunkTriangles = (1ull << 31) - 1;
/// The page writer: a page raw, compressed and padded, beside what is written behind.
constexpr uint64_t kPageWriterBytes = kWriteBehindBytes + 2 * kMiB;
/// A treelet: records of its pages, entries, the binary and the wide tree above it, and the copies of these while the
/// top tree is put together.
constexpr uint64_t kTreeletBytes = 900;
/// Bytes of pages a triangle, for the number of treelets. Meshes take 18 to 20, triangles that share nothing 47.
constexpr uint64_t kPageBytesPerTriangle = 24;
/// An instance: its place, its row, the tree over instances and its copies.
constexpr uint64_t kInstanceBytes = 900;
constexpr uint64_t kEmitterBytes = 72;
/// Of JSON: the text, the parsed strings and what base64 becomes; an object as it is parsed and then as a node or an
/// accessor; any other value. Scenes of 300,000 nodes, accessors, meshes were seen to take 0.4 to 0.95 of it.
constexpr uint64_t kTextFactor = 4, kObjectBytes = 320, kValueBytes = 48;
constexpr uint64_t kSmallDocumentBytes = 32 * kMiB;
/// Smaller chunks are not worth their share of seeks and of pages that are not full.
constexpr uint64_t kMinChunkTriangles = 16384;
constexpr uint64_t kMaxWriteBufferBytes = 256u << 10;
constexpr uint32_t kMinGridCells = 4096, kMaxGridCells = 1u << 18;
constexpr uint64_t kTrianglesPerCell = 128;

uint64_t built_bytes(uint64_t triangles, const CornerLayout& layout, BvhBuilder builder) {
  return forest_bytes(triangles, layout, builder) + triangles * record_bytes(layout);
}

/// The most over all objects.
struct Largest {
  CornerLayout layout;        // all that any corner carries
  uint64_t triangles = 0;     // of all objects
  uint64_t object_bytes = 0;  // the object that takes most when it is built at once
  uint64_t least_bytes = 0;   // the same for a smallest chunk of it
  uint64_t object_triangles = 0;
};

Largest largest_of(const BuildMemoryNeeds& needs) {
  Largest largest;
  for (const BuildMemoryNeeds::Object& object : needs.objects) {
    largest.layout = united(largest.layout, object.layout);
    largest.triangles += object.triangles;
    largest.object_triangles = std::max(largest.object_triangles, object.triangles);
    largest.object_bytes = std::max(largest.object_bytes, built_bytes(object.triangles, object.layout, needs.builder));
    largest.least_bytes =
        std::max(largest.least_bytes, built_bytes(std::min(object.triangles, kMinChunkTriangles), object.layout, needs.builder));
  }
  return largest;
}

uint32_t cells_for(uint64_t triangles) {
  return std::clamp<uint32_t>(static_cast<uint32_t>(std::min<uint64_t>(triangles / kTrianglesPerCell, kMaxGridCells)),
                              kMinGridCells, kMaxGridCells);
}

/// The plan for this cap; nothing when it cannot work.
bool share_out(const BuildMemoryNeeds& needs, const Largest& largest, uint64_t cap, BuildMemoryPlan& plan) {
  plan.cap_bytes = cap;
  plan.forced_chunk_triangles = needs.forced_chunk_triangles;
  plan.builder = needs.builder;
  plan.process_bytes = kProcessBytes;
  plan.document_bytes = needs.document_bytes + needs.pose_bytes;
  plan.tables_bytes = (largest.triangles * kPageBytesPerTriangle / needs.treelet_bytes + 2 + needs.objects.size()) *
                          kTreeletBytes +
                      needs.instances * kInstanceBytes + needs.emitters * kEmitterBytes;
  plan.coverage_bytes = needs.coverage_bytes;
  plan.writing_bytes = kPageWriterBytes;
  const uint64_t resident = plan.process_bytes + plan.document_bytes + plan.tables_bytes + plan.coverage_bytes +
                            plan.writing_bytes;
  if (resident >= cap) return false;
  if (plan.process_bytes + plan.document_bytes + kThreadBytes + needs.decompress_bytes > cap) return false;
  // Shares that follow the cap alone; how many threads there are only says how much of a share is used.
  const uint64_t threads_share = std::max(kThreadBytes, (cap - resident) / 16);
  if (threads_share >= cap - resident || needs.image_bytes > cap - resident - kThreadBytes) return false;
  const uint64_t left = cap - resident - threads_share;
  plan.threads =
      static_cast<unsigned>(std::clamp<uint64_t>(threads_share / kThreadBytes, 1, std::max(1u, needs.threads)));
  plan.threads_bytes = plan.threads * kThreadBytes;
  const uint64_t page = page_in_flight_bytes(needs.treelet_bytes, largest.layout, needs.positions_on_grid);
  const uint64_t pages_share = std::max(2 * page, left / 8);
  const uint64_t lane = ObjectSource::lane_bytes(largest.layout, needs.pose_windows);
  const uint64_t lanes_share = std::max(lane, left / 4);
  if (pages_share + largest.least_bytes > left || lanes_share > left) return false;
  plan.pages_in_flight = static_cast<uint32_t>(std::min<uint64_t>(pages_share / page, 2 * plan.threads));
  plan.pages_bytes = plan.pages_in_flight * page;
  plan.lanes = static_cast<uint32_t>(std::min<uint64_t>(lanes_share / lane, plan.threads + 1));
  plan.reading_bytes = plan.lanes * lane;
  plan.chunk_bytes = std::min(left - pages_share, largest.object_bytes);
  if (plan.chunk_bytes >= largest.object_bytes && largest.object_triangles <= kMaxChunkTriangles) return true;

  // Some object goes through chunks: the grid, and the buffers while they are sorted.
  const uint64_t cells = cells_for(largest.object_triangles);
  const uint64_t chunks = 2 * (largest.object_bytes / plan.chunk_bytes + 1) + 1;
  const uint64_t part_tables = cells * 4 + chunks * 256;
  plan.buffers_bytes = std::max(cells * ChunkGrid::kCellBytes,
                                part_tables + chunks * kBlockBytes);
  if (plan.buffers_bytes + part_tables > left - lanes_share) return false;
  const uint64_t wanted = part_tables + chunks * kMaxWriteBufferBytes;
  plan.buffers_bytes = std::clamp(wanted, plan.buffers_bytes, left - lanes_share - part_tables);
  plan.buffers_bytes -= part_tables;
  return true;
}

}  // namespace

uint64_t BuildMemoryPlan::image_bytes() const {
  return cap_bytes - process_bytes - kThreadBytes - document_bytes - tables_bytes - coverage_bytes - writing_bytes;
}

uint64_t BuildMemoryPlan::chunk_triangles(const CornerLayout& layout) const {
  if (forced_chunk_triangles > 0) return forced_chunk_triangles;
  return std::clamp<uint64_t>(chunk_bytes / built_bytes(1, layout, builder), 1, kMaxChunkTriangles);
}

uint32_t BuildMemoryPlan::grid_cells(uint64_t triangles) const { return cells_for(triangles); }

uint64_t BuildMemoryPlan::write_buffer_bytes(uint64_t chunks) const {
  return std::clamp(align_down(buffers_bytes / std::max<uint64_t>(chunks, 1), kBlockBytes), kBlockBytes,
                    kMaxWriteBufferBytes);
}

Result<BuildMemoryPlan> plan_build_memory(const BuildMemoryNeeds& needs, uint64_t cap_bytes, const std::string& path) {
  const Largest largest = largest_of(needs);
  BuildMemoryPlan plan;
  if (share_out(needs, largest, cap_bytes, plan)) return plan;
  uint64_t low = cap_bytes >> 20, high = low + 1;  // in MiB: low does not work
  while (high < (1ull << 40) && !share_out(needs, largest, high << 20, plan)) low = high, high *= 2;
  while (high - low > 1) {
    const uint64_t middle = low + (high - low) / 2;
    (share_out(needs, largest, middle << 20, plan) ? high : low) = middle;
  }
  return Error{ErrorCode::kMemoryCap,
               fmt::format("{}: building needs {} MiB at least, the memory cap is {} MiB", path, high,
                           cap_bytes >> 20)};
}

Result<uint64_t> document_bytes(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kBuffered));
  SHOAL_ASSIGN_OR_RETURN(const auto chunks, gltf::find_glb_chunks(*file));
  const gltf::FileRange range = chunks ? chunks->json : gltf::FileRange{0, file->size_bytes()};
  std::vector<std::byte> block(std::min<uint64_t>(range.bytes, 256u << 10));
  uint64_t objects = 0, values = 0;
  for (uint64_t done = 0; done < range.bytes; done += block.size()) {
    const std::span<std::byte> part(block.data(), std::min<uint64_t>(block.size(), range.bytes - done));
    SHOAL_RETURN_IF_ERROR(file->read_at(range.offset + done, part));
    for (const std::byte b : part) {
      const char c = static_cast<char>(b);
      objects += c == '{';
      values += c == ',' || c == ':' || c == '[';
    }
  }
  return kTextFactor * range.bytes + kObjectBytes * objects + kValueBytes * values;
}

Status check_document(uint64_t bytes, uint64_t cap_bytes, const std::string& path) {
  if (bytes <= kSmallDocumentBytes || kProcessBytes + bytes <= cap_bytes) return {};
  // What else is needed is known once the document is read: instances are most of it.
  const uint64_t enough = kProcessBytes + kPageWriterBytes + bytes / kObjectBytes * (kObjectBytes + kInstanceBytes);
  return Error{ErrorCode::kMemoryCap,
               fmt::format("{}: building needs {} MiB at least to read the document, the memory cap is {} MiB; {} MiB "
                           "are enough for it and its instances",
                           path, (kProcessBytes + bytes) / kMiB + 1, cap_bytes >> 20, enough / kMiB + 1)};
}

Status check_instances(uint64_t instances, uint64_t document_bytes, uint64_t cap_bytes, const std::string& path) {
  // Documents are refused before, where they alone are too large; few instances leave it to the plan to name the cap.
  constexpr uint64_t kFewInstances = 4096;
  const uint64_t needed = kProcessBytes + document_bytes + instances * kInstanceBytes;
  if (instances <= kFewInstances || needed <= cap_bytes) return {};
  return Error{ErrorCode::kMemoryCap,
               fmt::format("{}: building needs {} MiB at least for its {} instances, the memory cap is {} MiB", path,
                           (needed + kPageWriterBytes) / kMiB + 1, instances, cap_bytes >> 20)};
}

}  // namespace shoal
