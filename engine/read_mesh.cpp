#include "engine/read_mesh.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/emitters.h"
#include "engine/vertex_pose.h"
#include "treelets/triangle_refs.h"

namespace shoal {

namespace {

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
  Status move();
  bool is_mirrored(size_t place) const { return turned.empty() ? mirrored : turned[place] != 0; }
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
  std::optional<VertexPose> pose;
  std::vector<uint8_t> turned;  // of a skinned mesh, for each vertex: its map mirrors
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
  const gltf::Mesh& mesh = document.meshes[source.mesh];
  if (!VertexPose::needed(mesh, primitive)) return {};
  const std::string place = fmt::format("meshes[{}].primitives[{}]", source.mesh, source.primitive);
  SHOAL_ASSIGN_OR_RETURN(pose, VertexPose::open(files, document, mesh, primitive, place, normal.has_value(),
                                                tangent.has_value(), vertex_count));
  return {};
}

template <class Function>
Status PrimitiveReader::State::each_window(Function function) {
  for (std::optional<AttributeWindow>* window : {&position, &normal, &tangent, &color, &uv[0], &uv[1], &uv[2], &uv[3]}) {
    if (*window) SHOAL_RETURN_IF_ERROR(function(**window));
  }
  return pose ? pose->each_window(function) : Status();
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

/// Morph targets first, then the skin or the node's place (glTF 2.0, section 3.7.2.2).
Status PrimitiveReader::State::move() {
  const auto pointer = [](std::optional<AttributeWindow>& window) { return window ? &*window : nullptr; };
  if (pose) pose->morph(*position, pointer(normal), pointer(tangent));
  if (pose && pose->skinned()) return pose->skin(*position, pointer(normal), pointer(tangent), turned);
  if (moved) move_points(*position, points);
  if (normal) move_directions(*normal, normals, mirrored ? -1 : 1);
  if (tangent) move_directions(*tangent, points, 1);
  return {};
}

void PrimitiveReader::State::append(const uint32_t* corners, uint32_t id, TriangleBlock& block) const {
  const bool turn = is_mirrored(corners[0]);
  const uint32_t places[3] = {corners[0], corners[turn ? 2 : 1], corners[turn ? 1 : 2]};
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
  const float* stored = &soup.positions[at];
  if (!has_area(stored) && !is_degenerate(stored)) ++block.zero_area_count;
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
    if (tangent && is_mirrored(place)) corners.back() = -corners.back();
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
  for (const uint64_t end = first + count; first < end; first += kWindowTriangles) {
    const uint64_t n = std::min(kWindowTriangles, end - first);
    s.indices.resize(3 * n);
    SHOAL_RETURN_IF_ERROR(s.stream->read(first, n, s.indices));
    SHOAL_RETURN_IF_ERROR(s.load(s.indices));
    SHOAL_RETURN_IF_ERROR(s.move());
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
  degenerate_count = zero_area_count = 0;
}

uint64_t PrimitiveReader::memory_bytes(CornerLayout layout, uint32_t pose_windows) {
  // For the indices, the positions and each attribute the accessor's blocks and a window; then the indices in hand.
  const uint64_t readers = 2ull + layout.normal + layout.tangent + layout.color + layout.uv_count;
  const uint64_t pose = pose_windows * AttributeWindow::memory_bytes(4) + (pose_windows > 0 ? kMaxWindowVertices : 0);
  return readers * gltf::kReaderBytes + 4 * kMaxWindowVertices * (3 + layout.floats()) + 3 * 4 * kWindowTriangles + pose;
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
