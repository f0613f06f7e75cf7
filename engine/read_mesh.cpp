#include "engine/read_mesh.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {

namespace {

constexpr uint64_t kChunkTriangles = 8192;
/// A chunk whose indices span more vertices than this is gathered one vertex at a time.
constexpr uint64_t kMaxWindowVertices = 4 * 3 * kChunkTriangles;

std::optional<uint32_t> find_attribute(const gltf::Primitive& primitive, const std::string& name) {
  const auto found = primitive.attributes.find(name);
  if (found == primitive.attributes.end()) return std::nullopt;
  return found->second;
}

/// The vertices of one attribute that a chunk of triangles uses.
class AttributeWindow {
 public:
  static Result<AttributeWindow> open(gltf::BufferFiles& files, const gltf::Document& document, uint32_t accessor,
                                      const std::string& place, uint32_t min_components, uint32_t max_components,
                                      uint64_t vertex_count) {
    AttributeWindow window;
    SHOAL_ASSIGN_OR_RETURN(gltf::AccessorReader reader, gltf::AccessorReader::open(files, document, accessor));
    window.width_ = reader.components();
    if (window.width_ < min_components || window.width_ > max_components || document.accessors[accessor].matrix) {
      return Error{ErrorCode::kInput, fmt::format("{}: {}: expected {} to {} components, found {}", document.path,
                                                  place, min_components, max_components, window.width_)};
    }
    if (reader.count() < vertex_count) {
      return Error{ErrorCode::kInput, fmt::format("{}: {}: expected {} vertices as in POSITION, found {}",
                                                  document.path, place, vertex_count, reader.count())};
    }
    window.reader_.emplace(std::move(reader));
    return window;
  }

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
  /// Component c, or `missing` when there is none or it is not finite.
  float value(size_t i, uint32_t c, float missing) const {
    if (c >= width_) return missing;
    const float v = values_[i * width_ + c];
    return std::isfinite(v) ? v : missing;
  }

 private:
  std::optional<gltf::AccessorReader> reader_;
  uint32_t width_ = 0;
  std::vector<float> values_;
};

void move_points(AttributeWindow& window, const AffineDouble& map) {
  for (size_t i = 0; i < window.count(); ++i) {
    float* v = window.vertex(i);
    const Vec3d p = map.point({v[0], v[1], v[2]});
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(p[c]);
  }
}

/// The first three components: mapped, unit length or zero.
void move_directions(AttributeWindow& window, const AffineDouble& map, double sign) {
  for (size_t i = 0; i < window.count(); ++i) {
    float* v = window.vertex(i);
    const Vec3d d = normalized_or_zero(map.vector({v[0], v[1], v[2]}));
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(d[c] * sign);
  }
}

class PrimitiveAppender {
 public:
  PrimitiveAppender(const gltf::Document& document, const MaterialPlan& plan, const PrimitiveSource& source,
                    const AffineDouble* bake, TriangleSoup& soup, ReadCounts& counts)
      : document_(document),
        plan_(plan),
        source_(source),
        primitive_(document.meshes[source.mesh].primitives[source.primitive]),
        soup_(soup),
        counts_(counts) {
    material_ = plan.material_of(primitive_);
    if (bake) points_ = *bake, moved_ = true;
    const double det = determinant(points_);
    mirrored_ = det < 0;
    // Cofactors stay finite where the inverse does not: a scene squashed flat keeps its normals.
    normals_ = cofactors(points_);
  }

  Status run(gltf::BufferFiles& files) {
    SHOAL_ASSIGN_OR_RETURN(gltf::TriangleStream stream, gltf::TriangleStream::open(files, document_, primitive_));
    SHOAL_RETURN_IF_ERROR(open_attributes(files, stream.vertex_count()));
    std::vector<uint32_t> indices;
    for (uint64_t first = 0; first < stream.count(); first += kChunkTriangles) {
      const uint64_t n = std::min(kChunkTriangles, stream.count() - first);
      indices.resize(3 * n);
      SHOAL_RETURN_IF_ERROR(stream.read(first, n, indices));
      SHOAL_RETURN_IF_ERROR(load_chunk(indices));
      move_chunk();
      for (uint64_t i = 0; i < n; ++i) {
        append(&indices[3 * i], source_.first_id + static_cast<uint32_t>(first + i));
      }
    }
    return {};
  }

 private:
  Status open_attributes(gltf::BufferFiles& files, uint64_t vertex_count) {
    const auto open = [&](const std::string& name, uint32_t lo, uint32_t hi,
                          std::optional<AttributeWindow>& window) -> Status {
      const auto accessor = find_attribute(primitive_, name);
      if (!accessor) return {};
      const std::string place = fmt::format("meshes[{}].primitives[{}].{}", source_.mesh, source_.primitive, name);
      SHOAL_ASSIGN_OR_RETURN(window,
                             AttributeWindow::open(files, document_, *accessor, place, lo, hi, vertex_count));
      return {};
    };
    SHOAL_RETURN_IF_ERROR(open("POSITION", 3, 3, position_));
    if (soup_.layout.normal) SHOAL_RETURN_IF_ERROR(open("NORMAL", 3, 3, normal_));
    // Tangents without normals mean nothing (glTF 2.0, section 3.7.2.1).
    if (soup_.layout.tangent && normal_ && wants_tangent()) SHOAL_RETURN_IF_ERROR(open("TANGENT", 4, 4, tangent_));
    if (soup_.layout.color) SHOAL_RETURN_IF_ERROR(open("COLOR_0", 3, 4, color_));
    const MaterialUvSets& sets = plan_.uv_sets[material_];
    for (uint32_t set = 0; set < sets.count; ++set) {
      const std::string name = fmt::format("TEXCOORD_{}", sets.texcoord[set]);
      SHOAL_RETURN_IF_ERROR(open(name, 2, 2, uv_[set]));
      if (!uv_[set]) {
        counts_.warnings.push_back(
            fmt::format("meshes[{}].primitives[{}] lacks {}, which its material's textures use", source_.mesh,
                        source_.primitive, name));
      }
    }
    return {};
  }

  bool wants_tangent() const { return plan_.materials[material_].normal_texture.texture != kNoIndex; }

  template <class Function>
  Status each_window(Function function) {
    for (std::optional<AttributeWindow>* window :
         {&position_, &normal_, &tangent_, &color_, &uv_[0], &uv_[1], &uv_[2], &uv_[3]}) {
      if (*window) SHOAL_RETURN_IF_ERROR(function(**window));
    }
    return {};
  }

  /// Loads the vertices of a chunk and turns its indices into places in the windows.
  Status load_chunk(std::vector<uint32_t>& indices) {
    const auto [lo, hi] = std::minmax_element(indices.begin(), indices.end());
    const uint64_t first = *lo, count = uint64_t{*hi} - first + 1;
    if (count <= kMaxWindowVertices) {
      SHOAL_RETURN_IF_ERROR(each_window([&](AttributeWindow& w) { return w.load_run(first, count); }));
      for (uint32_t& index : indices) index -= static_cast<uint32_t>(first);
    } else {
      SHOAL_RETURN_IF_ERROR(each_window([&](AttributeWindow& w) { return w.load_each(indices); }));
      for (size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<uint32_t>(i);
    }
    return {};
  }

  void move_chunk() {
    if (moved_) move_points(*position_, points_);
    if (normal_) move_directions(*normal_, normals_, mirrored_ ? -1 : 1);
    if (tangent_) move_directions(*tangent_, points_, 1);
  }

  void append(const uint32_t* corners, uint32_t id) {
    const uint32_t places[3] = {corners[0], corners[mirrored_ ? 2 : 1], corners[mirrored_ ? 1 : 2]};
    const float* p[3];
    bool usable = true;
    for (int k = 0; k < 3; ++k) {
      p[k] = position_->vertex(places[k]);
      usable = usable && std::isfinite(p[k][0]) && std::isfinite(p[k][1]) && std::isfinite(p[k][2]);
    }
    const auto same = [](const float* a, const float* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; };
    if (!usable || same(p[0], p[1]) || same(p[1], p[2]) || same(p[2], p[0])) {
      ++counts_.degenerate_count;
      return;
    }
    for (int k = 0; k < 3; ++k) soup_.positions.insert(soup_.positions.end(), p[k], p[k] + 3);
    soup_.primitive.push_back(id);
    soup_.material.push_back(material_);
    for (int k = 0; k < 3; ++k) append_corner(places[k]);
  }

  void append_corner(size_t place) {
    const auto put = [&](const std::optional<AttributeWindow>& window, uint32_t width, float missing) {
      for (uint32_t c = 0; c < width; ++c) {
        soup_.corners.push_back(window ? window->value(place, c, missing) : missing);
      }
    };
    if (soup_.layout.normal) put(normal_, 3, 0);
    if (soup_.layout.tangent) {
      put(tangent_, 4, 0);
      if (tangent_ && mirrored_) soup_.corners.back() = -soup_.corners.back();
    }
    if (soup_.layout.color) put(color_, 4, 1);
    for (uint32_t set = 0; set < soup_.layout.uv_count; ++set) put(uv_[set], 2, 0);
  }

  const gltf::Document& document_;
  const MaterialPlan& plan_;
  const PrimitiveSource source_;
  const gltf::Primitive& primitive_;
  TriangleSoup& soup_;
  ReadCounts& counts_;
  uint32_t material_ = 0;
  bool moved_ = false, mirrored_ = false;
  AffineDouble points_, normals_;
  std::optional<AttributeWindow> position_, normal_, tangent_, color_, uv_[kMaxUvSets];
};

}  // namespace

CornerLayout layout_of(const gltf::Primitive& primitive, const MaterialPlan& plan) {
  const uint32_t material = plan.material_of(primitive);
  CornerLayout layout;
  layout.normal = find_attribute(primitive, "NORMAL").has_value();
  layout.tangent = layout.normal && find_attribute(primitive, "TANGENT") &&
                   plan.materials[material].normal_texture.texture != kNoIndex;
  layout.color = find_attribute(primitive, "COLOR_0").has_value();
  layout.uv_count = static_cast<uint8_t>(plan.uv_sets[material].count);
  return layout;
}

CornerLayout united(const CornerLayout& a, const CornerLayout& b) {
  return {a.normal || b.normal, a.tangent || b.tangent, a.color || b.color, std::max(a.uv_count, b.uv_count)};
}

Status append_primitive(gltf::BufferFiles& files, const gltf::Document& document, const MaterialPlan& plan,
                        const PrimitiveSource& source, const AffineDouble* bake, TriangleSoup& soup,
                        ReadCounts& counts) {
  if (source.triangle_count == 0) return {};
  return PrimitiveAppender(document, plan, source, bake, soup, counts).run(files);
}

}  // namespace shoal
