// Buffers, buffer views and accessors: after these sections every byte range is known to lie inside its buffer.
#include <fmt/format.h>

#include "io/gltf_sections.h"
#include "io/uri.h"

namespace shoal::gltf {

namespace {

/// glTF allows 252; larger ones are read as well, as long as a window still holds many elements.
constexpr uint64_t kMaxStrideBytes = 4096;

void read_buffer_source(const JsonNode& node, uint64_t i, const std::optional<FileRange>& binary,
                        Document& document, Buffer& buffer) {
  const JsonNode meshopt = node.object("extensions").object("EXT_meshopt_compression");
  buffer.placeholder = meshopt.boolean("fallback", false);
  if (buffer.placeholder) return;
  const std::string uri = node.text("uri");
  if (uri.empty()) {
    if (i != 0 || !binary)
      return node.fail_at("uri", "a URI (only the first buffer of a .glb has none)", "nothing");
    if (binary->bytes < buffer.byte_length) {
      return node.fail_at("byteLength", fmt::format("at most the {} bytes of the BIN chunk", binary->bytes),
                          fmt::format("{}", buffer.byte_length));
    }
    buffer.path = document.path;
    buffer.path_offset = binary->offset;
  } else if (is_data_uri(uri)) {
    auto bytes = decode_data_uri(uri);
    if (!bytes.ok()) return node.fail_at("uri", bytes.error().message, printable(uri));
    buffer.embedded = std::move(bytes).value();
    if (buffer.embedded.size() < buffer.byte_length) {
      node.fail_at("byteLength", fmt::format("at most the {} bytes of the URI", buffer.embedded.size()),
                   fmt::format("{}", buffer.byte_length));
    }
  } else {
    auto path = resolve_uri(document.folder, uri);
    if (!path.ok()) return node.fail_at("uri", path.error().message, printable(uri));
    buffer.path = std::move(path).value();
  }
}

MeshoptMode read_meshopt_mode(const JsonNode& node) {
  const std::string mode = node.text("mode");
  if (mode == "ATTRIBUTES") return MeshoptMode::kAttributes;
  if (mode == "TRIANGLES") return MeshoptMode::kTriangles;
  if (mode != "INDICES") node.fail_at("mode", "ATTRIBUTES, TRIANGLES or INDICES", printable(mode));
  return MeshoptMode::kIndices;
}

MeshoptFilter read_meshopt_filter(const JsonNode& node) {
  const std::string filter = node.text("filter", "NONE");
  if (filter == "OCTAHEDRAL") return MeshoptFilter::kOctahedral;
  if (filter == "QUATERNION") return MeshoptFilter::kQuaternion;
  if (filter == "EXPONENTIAL") return MeshoptFilter::kExponential;
  if (filter != "NONE") node.fail_at("filter", "NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL", printable(filter));
  return MeshoptFilter::kNone;
}

/// Whether the codec knows elements of such a size.
bool stride_fits(const MeshoptView& packed) {
  const uint32_t stride = packed.byte_stride;
  if (packed.mode != MeshoptMode::kAttributes) {
    return packed.filter == MeshoptFilter::kNone && (stride == 2 || stride == 4);
  }
  if (packed.filter == MeshoptFilter::kOctahedral) return stride == 4 || stride == 8;
  if (packed.filter == MeshoptFilter::kQuaternion) return stride == 8;
  return stride > 0 && stride % 4 == 0 && stride <= 256;
}

/// The codecs need two bits for 16 bytes at least, so a count that is no lie stays below this many times the bytes.
constexpr uint64_t kMaxMeshoptGrowth = 64;

void read_meshopt_view(const JsonNode& node, Document& document, BufferView& view) {
  MeshoptView packed;
  packed.buffer = node.required_index("buffer", document.buffers.size());
  packed.byte_offset = node.whole("byteOffset", 0);
  packed.byte_length = node.required_whole("byteLength");
  packed.count = node.required_whole("count");
  packed.byte_stride = static_cast<uint32_t>(node.required_whole("byteStride", 256));
  packed.mode = read_meshopt_mode(node);
  packed.filter = read_meshopt_filter(node);
  if (node.failed()) return;
  const Buffer& buffer = document.buffers[packed.buffer];
  if (buffer.placeholder || packed.byte_offset > buffer.byte_length ||
      packed.byte_length > buffer.byte_length - packed.byte_offset) {
    return node.fail_at("byteLength", fmt::format("a range of the {} bytes of buffers[{}]{}", buffer.byte_length, packed.buffer,
                                                  buffer.placeholder ? ", which is no fallback" : ""),
                        fmt::format("{} bytes from {}", packed.byte_length, packed.byte_offset));
  }
  if (!stride_fits(packed) || (packed.mode == MeshoptMode::kTriangles && packed.count % 3 != 0)) {
    return node.fail_at("byteStride", "a stride and a count that mode and filter allow",
                        fmt::format("{} elements of {} bytes", packed.count, packed.byte_stride));
  }
  if (packed.count > kMaxWhole / 256 || packed.count * packed.byte_stride != view.byte_length ||
      view.byte_length / kMaxMeshoptGrowth > packed.byte_length) {
    return node.fail_at("count", fmt::format("the {} bytes of the view, from {} compressed ones", view.byte_length,
                                             packed.byte_length),
                        fmt::format("{} elements of {} bytes", packed.count, packed.byte_stride));
  }
  view.meshopt = static_cast<uint32_t>(document.meshopt_views.size());
  document.meshopt_views.push_back(packed);
}

void read_views(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode array = root.array("bufferViews", limits.objects_count);
  document.views.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    const JsonNode node = array.object_at(i);
    BufferView& view = document.views[i];
    view.buffer = node.required_index("buffer", document.buffers.size());
    view.byte_offset = node.whole("byteOffset", 0);
    view.byte_length = node.required_whole("byteLength");
    view.byte_stride = static_cast<uint32_t>(node.whole("byteStride", 0, kMaxStrideBytes));
    if (root.failed()) return;
    const uint64_t buffer_bytes = document.buffers[view.buffer].byte_length;
    if (view.byte_offset > buffer_bytes || view.byte_length > buffer_bytes - view.byte_offset) {
      node.fail_at("byteLength",
                   fmt::format("a view inside the {} bytes of buffers[{}]", buffer_bytes, view.buffer),
                   fmt::format("{} bytes from {}", view.byte_length, view.byte_offset));
    }
    const JsonNode packed = node.object("extensions").object("EXT_meshopt_compression");
    if (packed.present()) {
      read_meshopt_view(packed, document, view);
    } else if (document.buffers[view.buffer].placeholder) {
      node.fail_at("buffer", "a buffer with bytes", "a fallback of EXT_meshopt_compression");
    }
  }
}

/// True when `count` elements at `stride` from `offset`, the last one `element` long, lie in `room` bytes.
bool fits(uint64_t room, uint64_t offset, uint64_t count, uint64_t stride, uint64_t element) {
  if (offset > room) return false;
  if (count == 0) return true;
  room -= offset;
  return element <= room && count - 1 <= (room - element) / stride;
}

void read_kind(const JsonNode& node, Accessor& accessor) {
  struct Kind {
    const char* name;
    uint32_t components;
    bool matrix;
  };
  constexpr Kind kKinds[] = {{"SCALAR", 1, false}, {"VEC2", 2, false}, {"VEC3", 3, false}, {"VEC4", 4, false},
                             {"MAT2", 4, true},    {"MAT3", 9, true},  {"MAT4", 16, true}};
  const std::string name = node.text("type");
  for (const Kind& kind : kKinds) {
    if (name != kind.name) continue;
    accessor.components = kind.components;
    accessor.matrix = kind.matrix;
    return;
  }
  node.fail_at("type", "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4", name.empty() ? "nothing" : printable(name));
}

ComponentType read_component_type(const JsonNode& node) {
  const uint64_t code = node.required_whole("componentType");
  if (code >= 5120 && code <= 5126 && code != 5124) return static_cast<ComponentType>(code);
  node.fail_at("componentType", "5120, 5121, 5122, 5123, 5125 or 5126", fmt::format("{}", code));
  return ComponentType::kFloat;
}

void check_room(const JsonNode& node, const Document& document, uint32_t view, uint64_t offset, uint64_t count,
                uint64_t stride, uint64_t element) {
  const uint64_t room = document.views[view].byte_length;
  if (fits(room, offset, count, stride, element)) return;
  node.fail(fmt::format("values inside the {} bytes of bufferViews[{}]", room, view),
            fmt::format("{} elements of {} bytes at a stride of {} from byte {}", count, element, stride, offset));
}

SparseAccessor read_sparse(const JsonNode& node, const Document& document, const Accessor& accessor) {
  SparseAccessor sparse;
  sparse.count = node.required_whole("count");
  if (sparse.count > accessor.count) {
    node.fail_at("count", fmt::format("at most the {} elements of the accessor", accessor.count),
                 fmt::format("{}", sparse.count));
  }
  const JsonNode indices = node.object("indices"), values = node.object("values");
  sparse.indices_view = indices.required_index("bufferView", document.views.size());
  sparse.indices_offset = indices.whole("byteOffset", 0);
  sparse.values_view = values.required_index("bufferView", document.views.size());
  sparse.values_offset = values.whole("byteOffset", 0);
  sparse.indices_type = read_component_type(indices);
  if (sparse.indices_type != ComponentType::kUnsignedByte && sparse.indices_type != ComponentType::kUnsignedShort &&
      sparse.indices_type != ComponentType::kUnsignedInt) {
    indices.fail_at("componentType", "5121, 5123 or 5125",
                    fmt::format("{}", static_cast<int>(sparse.indices_type)));
  }
  if (node.failed()) return sparse;
  const uint64_t index = component_bytes(sparse.indices_type), element = element_bytes(accessor);
  check_room(indices, document, sparse.indices_view, sparse.indices_offset, sparse.count, index, index);
  check_room(values, document, sparse.values_view, sparse.values_offset, sparse.count, element, element);
  return sparse;
}

void read_accessor(const JsonNode& node, const Limits& limits, const Document& document, Accessor& accessor) {
  accessor.view = node.index("bufferView", document.views.size());
  accessor.byte_offset = node.whole("byteOffset", 0);
  // Without a view nothing in the file stands behind the count, so it has a budget of its own.
  accessor.count = node.required_whole("count", accessor.view ? kMaxWhole : limits.objects_count);
  accessor.type = read_component_type(node);
  accessor.normalized = node.boolean("normalized", false);
  read_kind(node, accessor);
  if (node.failed()) return;
  if (accessor.view) {
    const uint64_t element = element_bytes(accessor);
    const uint64_t stride = document.views[*accessor.view].byte_stride;
    if (stride != 0 && stride < element) {
      return node.fail(fmt::format("elements of at most the {} bytes of the view's stride", stride),
                       fmt::format("{}", element));
    }
    check_room(node, document, *accessor.view, accessor.byte_offset, accessor.count, stride == 0 ? element : stride,
               element);
  }
  const JsonNode sparse = node.object("sparse");
  if (sparse.present()) accessor.sparse = read_sparse(sparse, document, accessor);
}

}  // namespace

uint64_t element_bytes(const Accessor& accessor) {
  const uint64_t bytes = component_bytes(accessor.type);
  if (!accessor.matrix) return bytes * accessor.components;
  const uint64_t side = accessor.components == 4 ? 2 : accessor.components == 9 ? 3 : 4;
  return side * ((side * bytes + 3) / 4 * 4);
}

void read_buffers(const JsonNode& root, const std::optional<FileRange>& binary, const Limits& limits,
                  Document& document) {
  const JsonNode array = root.array("buffers", limits.objects_count);
  document.buffers.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    const JsonNode node = array.object_at(i);
    document.buffers[i].byte_length = node.required_whole("byteLength");
    read_buffer_source(node, i, binary, document, document.buffers[i]);
  }
}

void read_accessors(const JsonNode& root, const Limits& limits, Document& document) {
  read_views(root, limits, document);
  const JsonNode array = root.array("accessors", limits.objects_count);
  document.accessors.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    read_accessor(array.object_at(i), limits, document, document.accessors[i]);
  }
}

}  // namespace shoal::gltf
