#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "io/gltf_accessor.h"

namespace shoal::gltf {

namespace {

/// Corners of strips and fans are undone in pieces of this many triangles, on the stack.
constexpr uint64_t kPieceTriangles = 1024;

uint64_t triangle_count(PrimitiveMode mode, uint64_t corner_count) {
  if (mode == PrimitiveMode::kTriangles) return corner_count / 3;
  return corner_count < 3 ? 0 : corner_count - 2;
}

}  // namespace

Result<TriangleStream> TriangleStream::describe(const Document& document, const Primitive& primitive) {
  TriangleStream stream;
  const auto position = primitive.attributes.find("POSITION");
  const bool has_triangles = primitive.mode == PrimitiveMode::kTriangles ||
                             primitive.mode == PrimitiveMode::kTriangleStrip ||
                             primitive.mode == PrimitiveMode::kTriangleFan;
  if (!has_triangles || position == primitive.attributes.end()) return stream;
  stream.mode_ = primitive.mode;
  stream.vertex_count_ = document.accessors[position->second].count;
  stream.place_ = fmt::format("{}: accessors[{}]", document.path, primitive.indices.value_or(position->second));
  constexpr uint64_t kMaxVertices = std::numeric_limits<uint32_t>::max();
  if (stream.vertex_count_ > kMaxVertices) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: accessors[{}].count: expected at most {} vertices, found {}", document.path,
                             position->second, kMaxVertices, stream.vertex_count_)};
  }
  uint64_t corner_count = stream.vertex_count_;
  if (primitive.indices) {
    const Accessor& indices = document.accessors[*primitive.indices];
    corner_count = indices.count;
    stream.restart_ = std::numeric_limits<uint32_t>::max() >> (32 - 8 * component_bytes(indices.type));
  }
  stream.count_ = triangle_count(stream.mode_, corner_count);
  return stream;
}

Result<TriangleStream> TriangleStream::open(BufferFiles& files, const Document& document,
                                            const Primitive& primitive) {
  SHOAL_ASSIGN_OR_RETURN(TriangleStream stream, describe(document, primitive));
  const bool draws = stream.vertex_count_ > 0 || stream.count_ > 0;
  if (draws && primitive.indices) {
    SHOAL_ASSIGN_OR_RETURN(stream.indices_, AccessorReader::open(files, document, *primitive.indices));
  }
  return stream;
}

Status TriangleStream::check_range(uint64_t first, std::span<const uint32_t> indices) const {
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < vertex_count_ && indices[i] != restart_) continue;
    return Error{
        ErrorCode::kInput,
        fmt::format("{}: index {}: expected a vertex below {}, found {}{}", place_, first + i, vertex_count_,
                    indices[i], indices[i] == restart_ ? " (primitive restart, which glTF forbids)" : "")};
  }
  return {};
}

Status TriangleStream::read_corners(uint64_t first, std::span<uint32_t> out) {
  if (indices_) {
    SHOAL_RETURN_IF_ERROR(indices_->read_indices(first, out.size(), out));
    return check_range(first, out);
  }
  std::iota(out.begin(), out.end(), static_cast<uint32_t>(first));
  return {};
}

Status TriangleStream::read(uint64_t first, uint64_t n, std::span<uint32_t> out) {
  SHOAL_CHECK(first <= count_ && n <= count_ - first && out.size() / 3 >= n);
  if (n == 0) return {};
  if (mode_ == PrimitiveMode::kTriangles) return read_corners(3 * first, out.first(3 * n));
  std::array<uint32_t, 1> hub{};
  if (mode_ == PrimitiveMode::kTriangleFan) SHOAL_RETURN_IF_ERROR(read_corners(0, hub));
  std::array<uint32_t, kPieceTriangles + 2> corners;
  uint32_t* target = out.data();
  while (n > 0) {
    const uint64_t piece = std::min(n, kPieceTriangles);
    SHOAL_RETURN_IF_ERROR(read_corners(first, std::span(corners).first(piece + 2)));
    for (uint64_t i = 0; i < piece; ++i) {
      // glTF 2.0, section 3.7.2.1: strips turn every other triangle, fans end each at the first vertex.
      const uint64_t odd = (first + i) % 2;
      const bool fan = mode_ == PrimitiveMode::kTriangleFan;
      *target++ = fan ? corners[i + 1] : corners[i];
      *target++ = fan ? corners[i + 2] : corners[i + 1 + odd];
      *target++ = fan ? hub[0] : corners[i + 2 - odd];
    }
    first += piece;
    n -= piece;
  }
  return {};
}

}  // namespace shoal::gltf
