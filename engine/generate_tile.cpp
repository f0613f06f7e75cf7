#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/generate_kinds.h"
#include "engine/noise.h"
#include "engine/scene_composer.h"
#include "engine/tile_source.h"

namespace shoal {
namespace {

// Each copy but the first is bent by smooth noise of this share of the source's diagonal, over waves of that share:
// enough that no triangle equals another's, too little to spoil its look.
constexpr double kBend = 0.004, kBendWave = 0.3;
constexpr uint64_t kMaxTileObjects = 1u << 23;  // copies times groups: what the document then costs in memory

/// Copy k of a square grid: rings around the first.
glm::dvec2 cell_of(uint64_t copy) {
  if (copy == 0) return {0, 0};
  uint64_t ring = 1, first = 1;
  while (copy >= first + 8 * ring) first += 8 * ring, ++ring;
  const uint64_t side = (copy - first) / (2 * ring);
  const double r = static_cast<double>(ring);
  const double step = static_cast<double>((copy - first) % (2 * ring)) - r + 1;
  const glm::dvec2 corners[4] = {{r, step}, {-step, r}, {-r, -step}, {step, -r}};
  return corners[side];
}

class TileWriter {
 public:
  TileWriter(const GenerateContext& context, GltfWriter& writer, TileSource& source)
      : context_(&context), writer_(&writer), source_(&source), files_(context.fs, source.document) {}

  Status write(uint64_t copies) {
    SHOAL_RETURN_IF_ERROR(write_shared());
    const glm::dvec3 extent = source_->hi - source_->lo;
    diagonal_ = std::sqrt(glm::dot(extent, extent));
    // Room for the bends of two neighbours, so that copies do not cut into each other.
    const glm::dvec2 pitch(extent.x + 4 * kBend * diagonal_, extent.z + 4 * kBend * diagonal_);
    for (uint64_t copy = 0; copy < copies; ++copy) {
      const glm::dvec2 place = cell_of(copy) * pitch;
      SHOAL_RETURN_IF_ERROR(write_copy(copy, glm::dvec3(place.x, 0, place.y)));
      context_->report_progress("writing", copy + 1, copies);
    }
    add_cameras(copies, pitch);
    return {};
  }

 private:
  /// What all copies share: indices and every attribute but the positions.
  Status write_shared() {
    for (const SourceGroup& group : source_->groups) {
      gltf::Primitive primitive;
      primitive.material = group.material;
      for (const std::string& name : group.attributes) {
        SHOAL_ASSIGN_OR_RETURN(primitive.attributes[name], write_attribute(group, name));
      }
      SHOAL_ASSIGN_OR_RETURN(primitive.indices, write_indices(group));
      primitives_.push_back(primitive);
      SHOAL_RETURN_IF_ERROR(writer_->status());
    }
    return {};
  }

  Result<uint32_t> write_attribute(const SourceGroup& group, const std::string& name) {
    const uint32_t first = group.members[0].primitive->attributes.at(name);
    const uint32_t components = source_->document.accessors[first].components;
    if (components < 2 || components > 4) {
      return Error{ErrorCode::kInput, fmt::format("{}: {}: expected VEC2, VEC3 or VEC4, found {} components",
                                                  source_->document.path, name, components)};
    }
    constexpr AccessorKind kKinds[] = {AccessorKind::kVec2, AccessorKind::kVec3, AccessorKind::kVec4};
    writer_->begin_accessor(kKinds[components - 2], group.vertices_count);
    for (const SourceMember& member : group.members) {
      const glm::dmat3 linear(member.to_world);
      const glm::dmat3 for_normals = cofactors(linear);
      SHOAL_RETURN_IF_ERROR(
          read_attribute(files_, source_->document, member, name, [&](std::span<float> values, uint32_t) {
            if (name == "NORMAL") turn(values, 3, for_normals);
            if (name == "TANGENT") turn(values, 4, linear);
            writer_->append_floats(values);
          }));
    }
    return writer_->end_accessor();
  }

  /// The inverse transpose times the determinant: maps normals, and exists for every matrix.
  static glm::dmat3 cofactors(const glm::dmat3& m) {
    const glm::dmat3 result(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    return glm::dot(m[0], result[0]) < 0 ? -result : result;
  }

  static void turn(std::span<float> values, uint32_t stride, const glm::dmat3& linear) {
    for (size_t i = 0; i + 2 < values.size(); i += stride) {
      glm::dvec3 v = linear * glm::dvec3(values[i], values[i + 1], values[i + 2]);
      const double length = std::sqrt(glm::dot(v, v));
      if (length > 0 && length < 1e300) v /= length;
      for (int c = 0; c < 3; ++c) values[i + static_cast<size_t>(c)] = static_cast<float>(v[c]);
    }
  }

  Result<uint32_t> write_indices(const SourceGroup& group) {
    constexpr uint64_t kChunkTriangles = 8192;
    writer_->begin_accessor(group.vertices_count <= 65535 ? AccessorKind::kIndex16 : AccessorKind::kIndex32,
                            group.triangles_count * 3);
    std::vector<uint32_t> indices;
    uint32_t base = 0;
    for (const SourceMember& member : group.members) {
      SHOAL_ASSIGN_OR_RETURN(gltf::TriangleStream stream,
                             gltf::TriangleStream::open(files_, source_->document, *member.primitive));
      for (uint64_t first = 0; first < stream.count(); first += kChunkTriangles) {
        const uint64_t n = std::min(kChunkTriangles, stream.count() - first);
        indices.resize(n * 3);
        SHOAL_RETURN_IF_ERROR(stream.read(first, n, indices));
        for (uint32_t& index : indices) index += base;
        for (size_t i = 0; member.mirrored && i < indices.size(); i += 3) std::swap(indices[i + 1], indices[i + 2]);
        writer_->append_indices(indices);
      }
      base += static_cast<uint32_t>(member.vertices_count);
    }
    return writer_->end_accessor();
  }

  Vec3 place(const glm::dvec3& point, uint64_t copy, const glm::dvec3& offset) const {
    if (copy == 0) return Vec3(point);  // the first is the source itself
    const auto seed = static_cast<uint32_t>(context_->options.seed * 3 + copy * 16);
    const glm::dvec3 at = point / (kBendWave * std::max(diagonal_, 1e-30));
    const glm::dvec3 bend(gradient_noise(at.x, at.y, at.z, seed), gradient_noise(at.x, at.y, at.z, seed + 1),
                          gradient_noise(at.x, at.y, at.z, seed + 2));
    return Vec3(point + offset + bend * (kBend * diagonal_));
  }

  Status write_copy(uint64_t copy, const glm::dvec3& offset) {
    gltf::Mesh mesh;
    mesh.name = fmt::format("copy {}", copy);
    std::vector<Vec3> chunk;
    for (size_t g = 0; g < source_->groups.size(); ++g) {
      const SourceGroup& group = source_->groups[g];
      gltf::Primitive primitive = primitives_[g];
      writer_->begin_accessor(AccessorKind::kPosition, group.vertices_count);
      for (const SourceMember& member : group.members) {
        const auto take = [&](const glm::dvec3& point) {
          chunk.push_back(place(point, copy, offset));
          if (chunk.size() == 8192) flush(chunk);
        };
        SHOAL_RETURN_IF_ERROR(read_world_positions(files_, source_->document, member, take));
        flush(chunk);
      }
      primitive.attributes["POSITION"] = writer_->end_accessor();
      mesh.primitives.push_back(std::move(primitive));
      SHOAL_RETURN_IF_ERROR(writer_->status());
    }
    gltf::Document& document = writer_->document();
    const std::string name = mesh.name;
    add_mesh_node(document, add_mesh(document, std::move(mesh)), {}, name);
    for (const SourceFixture& light : source_->lights) {
      const bool sun = document.lights[*light.node.light].type == gltf::LightType::kDirectional;
      if (!sun || copy == 0) add_fixture(light.node, offset);
    }
    return {};
  }

  void flush(std::vector<Vec3>& chunk) {
    if (!chunk.empty()) writer_->append_floats({&chunk[0].x, chunk.size() * 3});
    chunk.clear();
  }

  void add_fixture(gltf::Node node, const glm::dvec3& offset) {
    node.matrix[12] += offset.x, node.matrix[13] += offset.y, node.matrix[14] += offset.z;
    gltf::Document& document = writer_->document();
    document.roots.push_back(static_cast<uint32_t>(document.nodes.size()));
    document.nodes.push_back(std::move(node));
  }

  /// The source's cameras, in the first copy, then one from above that sees all copies.
  void add_cameras(uint64_t copies, const glm::dvec2& pitch) {
    for (const SourceFixture& camera : source_->cameras) add_fixture(camera.node, glm::dvec3(0));
    const Vec3 center((source_->lo + source_->hi) * 0.5);
    const float reach = static_cast<float>(std::sqrt(static_cast<double>(copies)) * std::max(pitch.x, pitch.y) +
                                           source_->hi.y - source_->lo.y);
    add_camera(writer_->document(), "all copies", center + Vec3(0.45f, 0.75f, 0.7f) * reach, center, 0.87);
  }

  const GenerateContext* context_;
  GltfWriter* writer_;
  TileSource* source_;
  gltf::BufferFiles files_;
  std::vector<gltf::Primitive> primitives_;  ///< by group, without POSITION
  double diagonal_ = 0;
};

/// Copies an image's bytes to the output folder under a name of ours; returns the name.
Result<std::string> copy_image(const GenerateContext& context, const gltf::Document& document, size_t index,
                               GenerateReport& report) {
  constexpr uint64_t kMaxImageBytes = 1ull << 30;
  const gltf::Image& image = document.images[index];
  std::vector<std::byte> bytes = image.embedded;
  if (image.view) {
    const gltf::BufferView& view = document.views[*image.view];
    if (view.byte_length > kMaxImageBytes) {
      return Error{ErrorCode::kInput, fmt::format("{}: images[{}]: expected at most {} bytes, found {}",
                                                  document.path, index, kMaxImageBytes, view.byte_length)};
    }
    gltf::BufferFiles files(context.fs, document);
    SHOAL_RETURN_IF_ERROR(files.check(view.buffer));
    bytes.resize(view.byte_length);
    SHOAL_RETURN_IF_ERROR(files.read(view.buffer, view.byte_offset, bytes));
  } else if (!image.path.empty()) {
    SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(context.fs, image.path, kMaxImageBytes));
    const auto raw = std::as_bytes(std::span(text));
    bytes.assign(raw.begin(), raw.end());
  }
  const bool png = bytes.size() > 1 && bytes[1] == std::byte{'P'};
  const std::string name = fmt::format("tile-image-{:03}.{}", index, png ? "png" : "jpg");
  SHOAL_RETURN_IF_ERROR(write_whole_file(context.fs, context.options.out_dir + "/" + name, bytes));
  report.file_bytes += bytes.size();
  return name;
}

}  // namespace

Status generate_tile(const GenerateContext& context, GltfWriter& writer, GenerateReport& report) {
  SHOAL_ASSIGN_OR_RETURN(TileSource source, open_tile_source(context.fs, context.options.source));
  const uint64_t copies = (context.options.triangles + source.triangles_count - 1) / source.triangles_count;
  if (copies * source.groups.size() > kMaxTileObjects) {
    return Error{ErrorCode::kUsage,
                 fmt::format("generate tile: {} copies of {} would be more than {} primitives; choose "
                             "a larger source",
                             copies, context.options.source, kMaxTileObjects)};
  }
  gltf::Document& document = writer.document();
  document.materials = source.document.materials;
  document.samplers = source.document.samplers;
  document.textures = source.document.textures;
  document.cameras = source.document.cameras;
  document.lights = source.document.lights;
  for (size_t i = 0; i < source.document.images.size(); ++i) {
    gltf::Image image;
    SHOAL_ASSIGN_OR_RETURN(image.path, copy_image(context, source.document, i, report));
    document.images.push_back(image);
  }
  SHOAL_RETURN_IF_ERROR(TileWriter(context, writer, source).write(copies));
  report.triangles_count = report.instanced_triangles_count = copies * source.triangles_count;
  report.instances_count = copies;
  return writer.status();
}

}  // namespace shoal
