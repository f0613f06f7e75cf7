#include "io/decompress_document.h"

#include <fmt/format.h>

#include <cstring>
#include <set>

#include "io/draco_mesh.h"
#include "io/gltf_sections.h"
#include "io/meshopt_codec.h"

namespace shoal::gltf {

namespace {

/// A Draco mesh and the accessors that describe what it holds: primitives that agree in these share what is decoded.
struct DracoUse {
  DracoPrimitive draco;
  uint32_t indices = 0;
  std::map<std::string, uint32_t> accessors;
  auto operator<=>(const DracoUse&) const = default;
};

DracoUse use_of(const Document& document, const Primitive& primitive) {
  DracoUse use{document.draco_primitives[*primitive.draco], *primitive.indices, {}};
  for (const auto& [name, id] : use.draco.attributes) use.accessors[name] = primitive.attributes.at(name);
  return use;
}

/// What the scene shows of what is compressed.
struct CompressedParts {
  std::set<uint32_t> views;
  std::map<DracoUse, std::vector<std::pair<uint32_t, uint32_t>>> meshes;  ///< and their primitives: mesh, primitive
};

class PartFinder {
 public:
  explicit PartFinder(const Document& document) : document_(document) {}

  CompressedParts find(std::optional<uint32_t> animation) {
    std::vector<uint32_t> stack = document_.roots;
    std::set<uint32_t> seen;
    while (!stack.empty()) {
      const uint32_t index = stack.back();
      const Node& node = document_.nodes[index];
      stack.pop_back();
      stack.insert(stack.end(), node.children.begin(), node.children.end());
      if (node.mesh && seen.insert(*node.mesh).second) add_mesh(*node.mesh);
      const auto instancing = document_.instancings.find(index);
      if (instancing != document_.instancings.end()) {
        add_instancing(instancing->second);
      } else if (node.mesh && node.skin) {
        add(document_.skins[*node.skin].inverse_bind);
      }
    }
    if (animation) {
      for (const AnimationChannel& channel : document_.animations[*animation].channels) {
        add(channel.input), add(channel.output);
      }
    }
    return std::move(parts_);
  }

 private:
  void add_view(uint32_t view) {
    if (document_.views[view].meshopt) parts_.views.insert(view);
  }
  void add(std::optional<uint32_t> index) {
    if (!index) return;
    const Accessor& accessor = document_.accessors[*index];
    if (accessor.view) add_view(*accessor.view);
    if (accessor.sparse) add_view(accessor.sparse->indices_view), add_view(accessor.sparse->values_view);
  }
  void add_instancing(const Instancing& instancing) {
    for (const auto& accessor : {instancing.translation, instancing.rotation, instancing.scale}) add(accessor);
  }
  void add_mesh(uint32_t mesh) {
    const std::vector<Primitive>& primitives = document_.meshes[mesh].primitives;
    for (uint32_t p = 0; p < primitives.size(); ++p) {
      const Primitive& primitive = primitives[p];
      add(primitive.indices);
      for (const auto& [name, accessor] : primitive.attributes) add(accessor);
      for (const MorphTarget& target : primitive.targets) add(target.position), add(target.normal), add(target.tangent);
      if (primitive.draco) parts_.meshes[use_of(document_, primitive)].emplace_back(mesh, p);
    }
  }

  const Document& document_;
  CompressedParts parts_;
};

uint64_t block_bytes(uint64_t bytes) { return align_up(bytes, kBlockBytes); }

uint64_t vertex_count(const Document& document, const DracoUse& use) {
  return document.accessors[use.accessors.at("POSITION")].count;
}

uint64_t attribute_bytes(const Document& document, uint32_t accessor) {
  return document.accessors[accessor].count * element_bytes(document.accessors[accessor]);
}

CompressionNeeds needs_of(const Document& document, const CompressedParts& parts) {
  CompressionNeeds needs;
  for (const uint32_t v : parts.views) {
    const BufferView& view = document.views[v];
    const uint64_t packed = document.meshopt_views[*view.meshopt].byte_length;
    needs.scratch_bytes += block_bytes(view.byte_length);
    needs.memory_bytes = std::max(needs.memory_bytes, packed + block_bytes(view.byte_length));
  }
  for (const auto& [use, primitives] : parts.meshes) {
    const uint64_t corners = document.accessors[use.indices].count;
    uint64_t largest = block_bytes(corners * 4);
    needs.scratch_bytes += largest;
    for (const auto& [name, accessor] : use.accessors) {
      const uint64_t bytes = block_bytes(attribute_bytes(document, accessor));
      needs.scratch_bytes += bytes;
      largest = std::max(largest, bytes);
    }
    const uint64_t mesh = DracoMesh::memory_bytes(corners / 3, vertex_count(document, use), use.accessors.size());
    needs.memory_bytes = std::max(needs.memory_bytes, document.views[use.draco.view].byte_length + largest + mesh);
  }
  return needs;
}

class Decompressor {
 public:
  Decompressor(FileSystem& fs, Document& document) : files_(fs, document), document_(document) {}

  Status run(FileSystem& fs, const std::string& folder, const std::atomic<bool>* stop, const CompressedParts& parts) {
    const uint64_t bytes = needs_of(document_, parts).scratch_bytes;
    SHOAL_ASSIGN_OR_RETURN(auto scratch, ScratchFile::create(fs, folder, bytes));
    scratch_ = std::move(scratch);
    const auto buffer = static_cast<uint32_t>(document_.buffers.size());
    std::vector<std::pair<uint32_t, BufferView>> decoded;  // put in place last: a view may be named twice
    for (const uint32_t v : parts.views) {
      SHOAL_RETURN_IF_ERROR(check(stop));
      SHOAL_ASSIGN_OR_RETURN(const uint64_t offset, decode_view(v));
      const BufferView& view = document_.views[v];
      decoded.emplace_back(v, BufferView{buffer, offset, view.byte_length, view.byte_stride, {}});
    }
    for (const auto& [use, primitives] : parts.meshes) {
      SHOAL_RETURN_IF_ERROR(check(stop));
      SHOAL_RETURN_IF_ERROR(decode_mesh(use, primitives, buffer));
    }
    for (auto& [v, view] : decoded) document_.views[v] = view;
    Buffer out;
    out.byte_length = scratch_->size_bytes();
    out.scratch = std::move(scratch_);
    document_.buffers.push_back(std::move(out));
    return {};
  }

 private:
  Status check(const std::atomic<bool>* stop) const {
    if (stop == nullptr || !stop->load(std::memory_order_relaxed)) return {};
    return Error{ErrorCode::kStopped, fmt::format("{}: the build was stopped before it was complete", document_.path)};
  }

  Result<std::vector<std::byte>> read_packed(uint32_t buffer, uint64_t offset, uint64_t bytes) {
    SHOAL_RETURN_IF_ERROR(files_.check(buffer));
    std::vector<std::byte> packed(bytes);
    SHOAL_RETURN_IF_ERROR(files_.read(buffer, offset, packed));
    return packed;
  }

  /// Room for a part, whose last block is zero where the part ends before it does.
  Result<std::span<std::byte>> room(uint64_t bytes) {
    SHOAL_ASSIGN_OR_RETURN(const auto all, room_.reserve(std::max<uint64_t>(block_bytes(bytes), kBlockBytes)));
    std::fill(all.begin() + static_cast<std::ptrdiff_t>(bytes), all.end(), std::byte{0});
    return all.first(bytes);
  }
  /// Puts room(bytes) behind what is in the file and says where.
  Result<uint64_t> put(std::span<const std::byte> part) {
    const uint64_t at = end_;
    end_ += block_bytes(part.size());
    SHOAL_RETURN_IF_ERROR(scratch_->write_at(at, std::span(part.data(), block_bytes(part.size()))));
    return at;
  }

  Result<uint64_t> decode_view(uint32_t v) {
    const MeshoptView& view = document_.meshopt_views[*document_.views[v].meshopt];
    const std::string place = fmt::format("{}: bufferViews[{}].extensions.EXT_meshopt_compression", document_.path, v);
    const uint64_t bytes = view.count * view.byte_stride;
    room_.shrink(block_bytes(bytes));  // what a larger one took is not this one's
    SHOAL_ASSIGN_OR_RETURN(const auto packed, read_packed(view.buffer, view.byte_offset, view.byte_length));
    SHOAL_ASSIGN_OR_RETURN(const auto out, room(bytes));
    SHOAL_RETURN_IF_ERROR(decode_meshopt(view, packed, out, place));
    return put(out);
  }

  Result<DracoMesh> decode_draco(const DracoUse& use, std::pair<uint32_t, uint32_t> first) {
    const BufferView& view = document_.views[use.draco.view];
    const std::string place = fmt::format("{}: meshes[{}].primitives[{}].extensions.KHR_draco_mesh_compression",
                                          document_.path, first.first, first.second);
    const uint64_t vertices = vertex_count(document_, use), corners = document_.accessors[use.indices].count;
    for (const auto& [name, accessor] : use.accessors) {
      if (document_.accessors[accessor].count == vertices && !document_.accessors[accessor].sparse) continue;
      return Error{ErrorCode::kInput,
                   fmt::format("{}: {}: expected {} elements, as POSITION has, and none sparse, found {}", place, name,
                               vertices, document_.accessors[accessor].count)};
    }
    if (corners % 3 != 0) {
      return Error{ErrorCode::kInput, fmt::format("{}: expected a multiple of 3 indices, found {}", place, corners)};
    }
    SHOAL_ASSIGN_OR_RETURN(const auto packed, read_packed(view.buffer, view.byte_offset, view.byte_length));
    return DracoMesh::decode(packed, corners / 3, vertices, use.accessors.size(), place);
  }

  /// An accessor on what was put at `offset`.
  uint32_t add_accessor(Accessor accessor, uint32_t buffer, uint64_t offset, uint64_t bytes) {
    accessor.view = static_cast<uint32_t>(document_.views.size());
    accessor.byte_offset = 0;
    document_.views.push_back({buffer, offset, bytes, 0, {}});
    document_.accessors.push_back(accessor);
    return static_cast<uint32_t>(document_.accessors.size() - 1);
  }

  Status decode_mesh(const DracoUse& use, const std::vector<std::pair<uint32_t, uint32_t>>& primitives,
                     uint32_t buffer) {
    room_.shrink(0);
    SHOAL_ASSIGN_OR_RETURN(const DracoMesh mesh, decode_draco(use, primitives.front()));
    Accessor indices = document_.accessors[use.indices];
    indices.type = ComponentType::kUnsignedInt;
    indices.sparse.reset();
    const uint64_t index_bytes = indices.count * 4;
    SHOAL_ASSIGN_OR_RETURN(const auto corners, room(index_bytes));
    mesh.read_indices({reinterpret_cast<uint32_t*>(corners.data()), indices.count});
    SHOAL_ASSIGN_OR_RETURN(uint64_t offset, put(corners));
    const uint32_t indices_accessor = add_accessor(indices, buffer, offset, index_bytes);
    std::map<std::string, uint32_t> attributes;
    for (const auto& [name, accessor] : use.accessors) {
      const Accessor described = document_.accessors[accessor];
      const uint64_t bytes = described.count * described.components * component_bytes(described.type);
      SHOAL_ASSIGN_OR_RETURN(const auto values, room(bytes));
      SHOAL_RETURN_IF_ERROR(mesh.read_attribute(use.draco.attributes.at(name), described, values));
      SHOAL_ASSIGN_OR_RETURN(offset, put(values));
      attributes[name] = add_accessor(described, buffer, offset, values.size());
    }
    for (const auto& [m, p] : primitives) {
      Primitive& primitive = document_.meshes[m].primitives[p];
      primitive.draco.reset();
      primitive.indices = indices_accessor;
      for (const auto& [name, accessor] : attributes) primitive.attributes[name] = accessor;
    }
    return {};
  }

  BufferFiles files_;
  Document& document_;
  std::shared_ptr<ScratchFile> scratch_;
  AlignedBuffer room_;
  uint64_t end_ = 0;
};

}  // namespace

CompressionNeeds compression_needs(const Document& document, std::optional<uint32_t> animation) {
  if (document.meshopt_views.empty() && document.draco_primitives.empty()) return {};
  return needs_of(document, PartFinder(document).find(animation));
}

Status decompress(FileSystem& fs, const std::string& folder, const std::atomic<bool>* stop, Document& document,
                  std::optional<uint32_t> animation) {
  if (document.meshopt_views.empty() && document.draco_primitives.empty()) return {};
  const CompressedParts parts = PartFinder(document).find(animation);
  if (parts.views.empty() && parts.meshes.empty()) return {};
  return Decompressor(fs, document).run(fs, folder, stop, parts);
}

}  // namespace shoal::gltf
