#include "engine/gltf_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace shoal {
namespace {

constexpr uint64_t kAlignment = 4;  // glTF 2.0 section 3.6.2.4

struct KindInfo {
  uint32_t components;
  gltf::ComponentType type;
};

KindInfo kind_info(AccessorKind kind) {
  switch (kind) {
    case AccessorKind::kPosition:
    case AccessorKind::kVec3:
      return {3, gltf::ComponentType::kFloat};
    case AccessorKind::kVec2:
      return {2, gltf::ComponentType::kFloat};
    case AccessorKind::kVec4:
      return {4, gltf::ComponentType::kFloat};
    case AccessorKind::kIndex16:
      return {1, gltf::ComponentType::kUnsignedShort};
    case AccessorKind::kIndex32:
      return {1, gltf::ComponentType::kUnsignedInt};
  }
  return {1, gltf::ComponentType::kFloat};
}

}  // namespace

GltfWriter::GltfWriter(FileSystem& fs, std::string folder, std::string name, const GltfWriterOptions& options)
    : fs_(&fs), folder_(std::move(folder)), name_(std::move(name)), options_(options) {}

Result<std::unique_ptr<GltfWriter>> GltfWriter::create(FileSystem& fs, const std::string& folder,
                                                       const std::string& name, const GltfWriterOptions& options) {
  std::unique_ptr<GltfWriter> writer(new GltfWriter(fs, folder, name, options));
  writer->buffer_.reserve(options.buffer_bytes);
  writer->open_part();
  SHOAL_RETURN_IF_ERROR(writer->status_);
  return writer;
}

std::string GltfWriter::gltf_path() const { return fmt::format("{}/{}.gltf", folder_, name_); }

void GltfWriter::open_part() {
  const std::string uri = fmt::format("{}-{:03}.bin", name_, parts_.size());
  Result<AtomicFile> part = AtomicFile::create(*fs_, folder_ + "/" + uri);
  if (!part.ok()) {
    status_ = part.error();
    return;
  }
  parts_.push_back(std::move(part).value());
  gltf::Buffer buffer;
  buffer.path = uri;
  document_.buffers.push_back(buffer);
  part_used_bytes_ = 0;
}

void GltfWriter::begin_accessor(AccessorKind kind, uint64_t count) {
  SHOAL_CHECK(!accessor_open_ && count > 0);
  const KindInfo info = kind_info(kind);
  const uint64_t element_bytes = uint64_t{info.components} * gltf::component_bytes(info.type);
  SHOAL_CHECK(count <= std::numeric_limits<uint64_t>::max() / 64);
  const uint64_t bytes = count * element_bytes;
  if (status_.ok() && part_used_bytes_ > 0 && part_used_bytes_ + bytes > options_.part_bytes) {
    flush();
    if (status_.ok()) open_part();
  }
  kind_ = kind, accessor_open_ = true, elements_left_ = count;

  gltf::BufferView view;
  view.buffer = static_cast<uint32_t>(document_.buffers.size() - 1);
  view.byte_offset = part_used_bytes_;
  view.byte_length = bytes;
  gltf::Accessor accessor;
  accessor.view = static_cast<uint32_t>(document_.views.size());
  accessor.count = count, accessor.components = info.components, accessor.type = info.type;
  PositionBounds bounds;
  if (kind == AccessorKind::kPosition) {
    bounds.present = true;
    std::fill(std::begin(bounds.lo), std::end(bounds.lo), std::numeric_limits<float>::max());
    std::fill(std::begin(bounds.hi), std::end(bounds.hi), std::numeric_limits<float>::lowest());
  }
  document_.views.push_back(view);
  document_.accessors.push_back(accessor);
  bounds_.push_back(bounds);
}

void GltfWriter::append_floats(std::span<const float> values) {
  const uint32_t components = kind_info(kind_).components;
  SHOAL_CHECK(accessor_open_ && kind_info(kind_).type == gltf::ComponentType::kFloat);
  SHOAL_CHECK(values.size() % components == 0 && values.size() / components <= elements_left_);
  elements_left_ -= values.size() / components;
  if (kind_ == AccessorKind::kPosition) {
    PositionBounds& bounds = bounds_.back();
    for (size_t i = 0; i < values.size(); ++i) {
      bounds.lo[i % 3] = std::min(bounds.lo[i % 3], values[i]);
      bounds.hi[i % 3] = std::max(bounds.hi[i % 3], values[i]);
    }
  }
  append_bytes(std::as_bytes(values));
}

void GltfWriter::append_indices(std::span<const uint32_t> values) {
  SHOAL_CHECK(accessor_open_ && values.size() <= elements_left_);
  elements_left_ -= values.size();
  if (kind_ == AccessorKind::kIndex32) return append_bytes(std::as_bytes(values));
  SHOAL_CHECK(kind_ == AccessorKind::kIndex16);
  uint16_t narrow[1024];
  while (!values.empty()) {
    const size_t n = std::min(values.size(), std::size(narrow));
    for (size_t i = 0; i < n; ++i) {
      SHOAL_CHECK(values[i] < 65535);  // 65535 is the primitive restart value
      narrow[i] = static_cast<uint16_t>(values[i]);
    }
    append_bytes(std::as_bytes(std::span(narrow, n)));
    values = values.subspan(n);
  }
}

uint32_t GltfWriter::end_accessor() {
  SHOAL_CHECK(accessor_open_ && elements_left_ == 0);
  accessor_open_ = false;
  constexpr std::byte kZeros[kAlignment] = {};
  append_bytes(std::span(kZeros, (kAlignment - part_used_bytes_ % kAlignment) % kAlignment));
  return static_cast<uint32_t>(document_.accessors.size() - 1);
}

void GltfWriter::append_bytes(std::span<const std::byte> bytes) {
  part_used_bytes_ += bytes.size();
  total_bytes_ += bytes.size();
  if (!status_.ok()) return;
  while (!bytes.empty()) {
    const size_t room = options_.buffer_bytes - buffer_.size();
    const size_t n = std::min<size_t>(room, bytes.size());
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.begin() + n);
    peak_buffered_bytes_ = std::max<uint64_t>(peak_buffered_bytes_, buffer_.capacity());
    bytes = bytes.subspan(n);
    if (buffer_.size() == options_.buffer_bytes) flush();
    if (!status_.ok()) return;
  }
}

void GltfWriter::flush() {
  if (!status_.ok() || buffer_.empty()) return;
  status_ = parts_.back().append(buffer_);
  buffer_.clear();
  document_.buffers.back().byte_length = parts_.back().size_bytes();
}

Status GltfWriter::status() const { return status_; }

Result<uint64_t> GltfWriter::finish() {
  SHOAL_CHECK(!accessor_open_);
  flush();
  SHOAL_RETURN_IF_ERROR(status_);
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(*fs_, gltf_path()));
  SHOAL_RETURN_IF_ERROR(write_gltf_json(document_, bounds_, file));
  for (AtomicFile& part : parts_) SHOAL_RETURN_IF_ERROR(part.commit());
  SHOAL_RETURN_IF_ERROR(file.commit());
  return total_bytes_ + file.size_bytes();
}

}  // namespace shoal
