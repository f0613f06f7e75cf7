#include "engine/consume_source.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

/// Every buffer that the triangles of a primitive are read from.
std::set<uint32_t> buffers_of(const gltf::Document& document, const gltf::Primitive& primitive) {
  std::set<uint32_t> buffers;
  const auto add = [&](uint32_t index) {
    const gltf::Accessor& accessor = document.accessors[index];
    if (accessor.view) buffers.insert(document.views[*accessor.view].buffer);
    if (!accessor.sparse) return;
    buffers.insert(document.views[accessor.sparse->indices_view].buffer);
    buffers.insert(document.views[accessor.sparse->values_view].buffer);
  };
  for (const auto& [name, accessor] : primitive.attributes) add(accessor);
  for (const gltf::MorphTarget& target : primitive.targets) {
    for (const auto& accessor : {target.position, target.normal, target.tangent}) {
      if (accessor) add(*accessor);
    }
  }
  if (primitive.indices) add(*primitive.indices);
  return buffers;
}

/// One name for a file, whatever it is called: `a.bin`, `./a.bin` and a link to it are the same part.
std::string file_name_of(const std::string& path) {
  std::error_code code;
  const stdfs::path canonical = stdfs::weakly_canonical(path, code);
  return code ? path : canonical.string();
}

/// Why the part must stay; nothing when it may go. Links lead elsewhere, and a second name is somebody else's.
std::string reason_to_keep(const std::string& path, const gltf::Document& document, const std::string& output) {
  std::error_code code;
  for (const gltf::Image& image : document.images) {
    if (!image.path.empty() && file_name_of(image.path) == file_name_of(path)) return "an image lies in it";
  }
  if (stdfs::equivalent(path, output, code)) return "it is the output";
  if (stdfs::is_symlink(path, code)) return "it is a link";
  if (const auto names = stdfs::hard_link_count(path, code); !code && names != 1) return "it has another name";
  const stdfs::path folder = stdfs::weakly_canonical(document.folder.empty() ? "." : document.folder, code);
  const stdfs::path relative = stdfs::weakly_canonical(path, code).lexically_relative(folder);
  if (relative.empty() || *relative.begin() == "..") return "it lies outside the scene's folder";
  return {};
}

/// A part by all its names, and who reads it last.
struct NamedPart {
  std::set<std::string> names;
  std::pair<uint32_t, uint32_t> last_user;  // mesh and primitive
  uint64_t bytes = 0;
};

}  // namespace

Result<SourceConsumer> SourceConsumer::plan(FileSystem& fs, const gltf::Document& document,
                                            const GeometryPlan& geometry, const std::string& output,
                                            std::vector<std::string>& warnings) {
  SourceConsumer consumer;
  consumer.fs_ = &fs;
  std::map<std::string, NamedPart> parts;
  for (const ObjectPlan& object : geometry.objects) {
    for (const uint32_t mesh : object.meshes) {
      for (const PrimitiveSource& source : geometry.meshes[mesh].primitives) {
        for (const uint32_t b : buffers_of(document, document.meshes[mesh].primitives[source.primitive])) {
          const gltf::Buffer& buffer = document.buffers[b];
          if (buffer.path == document.path) {
            return Error{ErrorCode::kUsage, fmt::format("{}: --consume needs a .gltf with parts of its own: the parts of "
                                                        "a .glb lie in the file itself", document.path)};
          }
          if (buffer.path.empty()) continue;
          NamedPart& part = parts[file_name_of(buffer.path)];
          part.names.insert(buffer.path);
          part.last_user = {mesh, source.primitive};
          part.bytes = std::max(part.bytes, buffer.path_offset + buffer.byte_length);
        }
      }
    }
  }
  for (const auto& [path, part] : parts) {
    std::string reason = reason_to_keep(path, document, output);
    for (const std::string& name : part.names) {
      if (reason.empty()) reason = reason_to_keep(name, document, output);
    }
    if (!reason.empty()) {
      warnings.push_back(fmt::format("{} is not consumed: {}", *part.names.begin(), reason));
    } else {
      consumer.parts_of_[part.last_user].push_back({path, part.bytes});
    }
  }
  return consumer;
}

Status SourceConsumer::source_done(const PrimitiveSource& source) {
  const auto found = parts_of_.find({source.mesh, source.primitive});
  if (found == parts_of_.end()) return {};
  for (const auto& [path, bytes] : found->second) {
    SHOAL_ASSIGN_OR_RETURN(const uint64_t released, fs_->release(path, 0, bytes));
    released_bytes_ += released;
  }
  return {};
}

}  // namespace shoal
