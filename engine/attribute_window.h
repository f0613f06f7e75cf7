// The vertices of one attribute that a chunk of triangles uses, as floats. Called by engine/read_mesh and
// engine/vertex_pose. Thread rule: as its BufferFiles. Memory: window_bytes() and the accessor's blocks.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "io/gltf_accessor.h"

namespace shoal {

/// Triangles that are decoded at once.
inline constexpr uint64_t kWindowTriangles = 8192;
/// Triangles whose indices span more vertices than this are gathered one vertex at a time.
inline constexpr uint64_t kMaxWindowVertices = 4 * 3 * kWindowTriangles;

/// The accessor of an attribute, if the primitive has it.
std::optional<uint32_t> find_attribute(const gltf::Primitive& primitive, const std::string& name);

class AttributeWindow {
 public:
  /// `place` is for messages. Fails with: kInput (other components, or fewer elements than vertices), kStorage.
  static Result<AttributeWindow> open(gltf::BufferFiles& files, const gltf::Document& document, uint32_t accessor,
                                      const std::string& place, uint32_t min_components, uint32_t max_components,
                                      uint64_t vertex_count);

  Status load_run(uint64_t first, uint64_t count) {
    values_.resize(count * width_);
    return reader_->read_floats(first, count, values_);
  }
  Status load_each(std::span<const uint32_t> vertices) {
    values_.resize(vertices.size() * width_);
    for (size_t i = 0; i < vertices.size(); ++i) {
      SHOAL_RETURN_IF_ERROR(reader_->read_floats(vertices[i], 1, std::span(values_).subspan(i * width_, width_)));
    }
    return {};
  }
  uint32_t width() const { return width_; }
  size_t count() const { return values_.size() / width_; }
  float* vertex(size_t i) { return &values_[i * width_]; }
  const float* vertex(size_t i) const { return &values_[i * width_]; }
  /// Component c, or `missing` when there is none or it is not finite.
  float value(size_t i, uint32_t c, float missing) const {
    if (c >= width_) return missing;
    const float v = values_[i * width_ + c];
    return std::isfinite(v) ? v : missing;
  }

  /// At most, with the blocks of its accessor.
  static uint64_t memory_bytes(uint32_t components) {
    return gltf::kReaderBytes + 4 * kMaxWindowVertices * components;
  }

 private:
  std::optional<gltf::AccessorReader> reader_;
  uint32_t width_ = 0;
  std::vector<float> values_;
};

}  // namespace shoal
