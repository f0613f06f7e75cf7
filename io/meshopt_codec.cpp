#include "io/meshopt_codec.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

namespace shoal::gltf {

namespace {

int decode(const MeshoptView& view, const unsigned char* packed, size_t packed_bytes, void* out) {
  switch (view.mode) {
    case MeshoptMode::kAttributes:
      return meshopt_decodeVertexBuffer(out, view.count, view.byte_stride, packed, packed_bytes);
    case MeshoptMode::kTriangles:
      return meshopt_decodeIndexBuffer(out, view.count, view.byte_stride, packed, packed_bytes);
    case MeshoptMode::kIndices:
      return meshopt_decodeIndexSequence(out, view.count, view.byte_stride, packed, packed_bytes);
  }
  return -1;
}

void filter(const MeshoptView& view, void* values) {
  switch (view.filter) {
    case MeshoptFilter::kNone:
      return;
    case MeshoptFilter::kOctahedral:
      return meshopt_decodeFilterOct(values, view.count, view.byte_stride);
    case MeshoptFilter::kQuaternion:
      return meshopt_decodeFilterQuat(values, view.count, view.byte_stride);
    case MeshoptFilter::kExponential:
      return meshopt_decodeFilterExp(values, view.count, view.byte_stride);
  }
}

/// What the error codes of meshopt_decode* stand for.
const char* reason(int code) {
  if (code == -1) return "a header of another codec or version";
  if (code == -2) return "too few bytes";
  return "bytes that are left over or broken";
}

}  // namespace

Status decode_meshopt(const MeshoptView& view, std::span<const std::byte> packed, std::span<std::byte> out,
                      const std::string& place) {
  SHOAL_CHECK(out.size() == view.count * view.byte_stride);
  if (view.count == 0) return {};
  const int code = decode(view, reinterpret_cast<const unsigned char*>(packed.data()), packed.size(), out.data());
  if (code != 0) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected {} elements of {} bytes compressed by meshoptimizer, found {}",
                                                place, view.count, view.byte_stride, reason(code))};
  }
  filter(view, out.data());
  return {};
}

}  // namespace shoal::gltf
