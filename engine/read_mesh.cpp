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
  const float* vertex(size_t i) const { return &values_[i * width_]; }
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

}  // namespace

struct PrimitiveReader::State {
  State(const gltf::Document& doc, const MaterialPlan& materials, const PrimitiveSource& from, CornerLayout corners,
        const AffineDouble* bake)
      : document(doc),
        plan(materials),
        source(from),
        primitive(doc.meshes[from.mesh].primitives[from.primitive]),
        layout(corners),
        material(materials.material_of(primitive)) {
    if (bake) points = *bake, moved = true;
    mirrored = determinant(points) < 0;
    // Cofactors stay finite where the inverse does not: a scene squashed flat keeps its normals.
    normals = cofactors(points);
  }

  Status open_attributes(gltf::BufferFiles& files, uint64_t vertex_count);
  template <class Function>
  Status each_window(Function function);
  Status load(std::vector<uint32_t>& of_corners);
  void move();
  void append(const uint32_t* corners, uint32_t id, TriangleBlock& block) const;
  void append_corner(size_t place, std::vector<float>& corners) const;
  bool wants_tangent() const { return plan.wants_tangents(material); }

  const gltf::Document& document;
  const MaterialPlan& plan;
  const PrimitiveSource source;
  const gltf::Primitive& primitive;
  const CornerLayout layout;
  const uint32_t material;
  bool moved = false, mirrored = false;
  AffineDouble points, normals;
  std::optional<gltf::TriangleStream> stream;
  std::optional<AttributeWindow> position, normal, tangent, color, uv[kMaxUvSets];
  std::vector<uint32_t> indices;
};

Status PrimitiveReader::State::open_attributes(gltf::BufferFiles& files, uint64_t vertex_count) {
  const auto open = [&](const std::string& name, uint32_t lo, uint32_t hi,
                        std::optional<AttributeWindow>& window) -> Status {
    const auto accessor = find_attribute(primitive, name);
    if (!accessor) return {};
    const std::string place = fmt::format("meshes[{}].primitives[{}].{}", source.mesh, source.primitive, name);
    SHOAL_ASSIGN_OR_RETURN(window, AttributeWindow::open(files, document, *accessor, place, lo, hi, vertex_count));
    return {};
  };
  SHOAL_RETURN_IF_ERROR(open("POSITION", 3, 3, position));
  if (layout.normal) SHOAL_RETURN_IF_ERROR(open("NORMAL", 3, 3, normal));
  // Tangents without normals mean nothing (glTF 2.0, section 3.7.2.1).
  if (layout.tangent && normal && wants_tangent()) SHOAL_RETURN_IF_ERROR(open("TANGENT", 4, 4, tangent));
  if (layout.color) SHOAL_RETURN_IF_ERROR(open("COLOR_0", 3, 4, color));
  const MaterialUvSets& sets = plan.uv_sets[material];
  for (uint32_t set = 0; set < std::min<uint32_t>(sets.count, layout.uv_count); ++set) {
    SHOAL_RETURN_IF_ERROR(open(fmt::format("TEXCOORD_{}", sets.texcoord[set]), 2, 2, uv[set]));
  }
  return {};
}

template <class Function>
Status PrimitiveReader::State::each_window(Function function) {
  for (std::optional<AttributeWindow>* window : {&position, &normal, &tangent, &color, &uv[0], &uv[1], &uv[2], &uv[3]}) {
    if (*window) SHOAL_RETURN_IF_ERROR(function(**window));
  }
  return {};
}

/// Loads the vertices of some triangles and turns their indices into places in the windows.
Status PrimitiveReader::State::load(std::vector<uint32_t>& of_corners) {
  const auto [lo, hi] = std::minmax_element(of_corners.begin(), of_corners.end());
  const uint64_t first = *lo, count = uint64_t{*hi} - first + 1;
  if (count <= kMaxWindowVertices) {
    SHOAL_RETURN_IF_ERROR(each_window([&](AttributeWindow& w) { return w.load_run(first, count); }));
    for (uint32_t& index : of_corners) index -= static_cast<uint32_t>(first);
  } else {
    SHOAL_RETURN_IF_ERROR(each_window([&](AttributeWindow& w) { return w.load_each(of_corners); }));
    for (size_t i = 0; i < of_corners.size(); ++i) of_corners[i] = static_cast<uint32_t>(i);
  }
  return {};
}

void PrimitiveReader::State::move() {
  if (moved) move_points(*position, points);
  if (normal) move_directions(*normal, normals, mirrored ? -1 : 1);
  if (tangent) move_directions(*tangent, points, 1);
}

void PrimitiveReader::State::append(const uint32_t* corners, uint32_t id, TriangleBlock& block) const {
  const uint32_t places[3] = {corners[0], corners[mirrored ? 2 : 1], corners[mirrored ? 1 : 2]};
  const float* p[3];
  bool usable = true;
  for (int k = 0; k < 3; ++k) {
    p[k] = position->vertex(places[k]);
    usable = usable && std::isfinite(p[k][0]) && std::isfinite(p[k][1]) && std::isfinite(p[k][2]);
  }
  const auto same = [](const float* a, const float* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; };
  if (!usable || same(p[0], p[1]) || same(p[1], p[2]) || same(p[2], p[0])) {
    ++block.degenerate_count;
    return;
  }
  TriangleSoup& soup = block.soup;
  const size_t at = soup.positions.size();
  soup.positions.resize(at + 9);
  for (int k = 0; k < 3; ++k) std::copy_n(p[k], 3, &soup.positions[at + 3 * static_cast<size_t>(k)]);
  soup.primitive.push_back(id);
  soup.material.push_back(material);
  if (layout.floats() == 0) return;
  for (int k = 0; k < 3; ++k) append_corner(places[k], soup.corners);
}

void PrimitiveReader::State::append_corner(size_t place, std::vector<float>& corners) const {
  const auto put = [&](const std::optional<AttributeWindow>& window, uint32_t width, float missing) {
    for (uint32_t c = 0; c < width; ++c) corners.push_back(window ? window->value(place, c, missing) : missing);
  };
  if (layout.normal) put(normal, 3, 0);
  if (layout.tangent) {
    put(tangent, 4, 0);
    if (tangent && mirrored) corners.back() = -corners.back();
  }
  if (layout.color) put(color, 4, 1);
  for (uint32_t set = 0; set < layout.uv_count; ++set) put(uv[set], 2, 0);
}

PrimitiveReader::PrimitiveReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
PrimitiveReader::PrimitiveReader(PrimitiveReader&&) noexcept = default;
PrimitiveReader& PrimitiveReader::operator=(PrimitiveReader&&) noexcept = default;
PrimitiveReader::~PrimitiveReader() = default;

Result<PrimitiveReader> PrimitiveReader::open(gltf::BufferFiles& files, const gltf::Document& document,
                                              const MaterialPlan& plan, const PrimitiveSource& source,
                                              CornerLayout layout, const AffineDouble* bake) {
  auto state = std::make_unique<State>(document, plan, source, layout, bake);
  SHOAL_ASSIGN_OR_RETURN(state->stream, gltf::TriangleStream::open(files, document, state->primitive));
  SHOAL_RETURN_IF_ERROR(state->open_attributes(files, state->stream->vertex_count()));
  return PrimitiveReader(std::move(state));
}

Status PrimitiveReader::read(uint64_t first, uint64_t count, TriangleBlock& block) {
  State& s = *state_;
  block.clear(s.layout, count);
  for (const uint64_t end = first + count; first < end; first += kChunkTriangles) {
    const uint64_t n = std::min(kChunkTriangles, end - first);
    s.indices.resize(3 * n);
    SHOAL_RETURN_IF_ERROR(s.stream->read(first, n, s.indices));
    SHOAL_RETURN_IF_ERROR(s.load(s.indices));
    s.move();
    for (uint64_t i = 0; i < n; ++i) {
      s.append(&s.indices[3 * i], s.source.first_id + static_cast<uint32_t>(first + i), block);
    }
  }
  return {};
}

void TriangleBlock::clear(CornerLayout layout, uint64_t expected) {
  soup.layout = layout;
  soup.positions.clear(), soup.primitive.clear(), soup.material.clear(), soup.corners.clear();
  soup.positions.reserve(9 * expected);
  soup.primitive.reserve(expected);
  soup.material.reserve(expected);
  soup.corners.reserve(3 * expected * layout.floats());
  degenerate_count = 0;
}

uint64_t PrimitiveReader::memory_bytes(CornerLayout layout) {
  // For the indices, the positions and each attribute the accessor's blocks and a window; then the indices in hand.
  const uint64_t readers = 2ull + layout.normal + layout.tangent + layout.color + layout.uv_count;
  return readers * gltf::kReaderBytes + 4 * kMaxWindowVertices * (3 + layout.floats()) + 3 * 4 * kChunkTriangles;
}

CornerLayout layout_of(const gltf::Primitive& primitive, const MaterialPlan& plan) {
  const uint32_t material = plan.material_of(primitive);
  CornerLayout layout;
  layout.normal = find_attribute(primitive, "NORMAL").has_value();
  layout.tangent = layout.normal && find_attribute(primitive, "TANGENT") &&
                   plan.wants_tangents(material);
  layout.color = find_attribute(primitive, "COLOR_0").has_value();
  layout.uv_count = static_cast<uint8_t>(plan.uv_sets[material].count);
  return layout;
}

CornerLayout united(const CornerLayout& a, const CornerLayout& b) {
  return {a.normal || b.normal, a.tangent || b.tangent, a.color || b.color, std::max(a.uv_count, b.uv_count)};
}

void note_missing_uv_sets(const gltf::Document& document, const MaterialPlan& plan, const PrimitiveSource& source,
                          std::vector<std::string>& warnings) {
  const gltf::Primitive& primitive = document.meshes[source.mesh].primitives[source.primitive];
  const MaterialUvSets& sets = plan.uv_sets[plan.material_of(primitive)];
  for (uint32_t set = 0; set < sets.count; ++set) {
    const std::string name = fmt::format("TEXCOORD_{}", sets.texcoord[set]);
    if (find_attribute(primitive, name)) continue;
    warnings.push_back(fmt::format("meshes[{}].primitives[{}] lacks {}, which its material's textures use", source.mesh,
                                   source.primitive, name));
  }
}

}  // namespace shoal
