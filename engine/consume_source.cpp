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
  if (primitive.indices) add(*primitive.indices);
  return buffers;
}

/// Why the part must stay; nothing when it may go. Links lead elsewhere, and a second name is somebody else's.
std::string reason_to_keep(const std::string& path, const gltf::Document& document, const std::string& output) {
  std::error_code code;
  for (const gltf::Image& image : document.images) {
    if (image.path == path) return "an image lies in it";
  }
  if (stdfs::equivalent(path, output, code)) return "it is the output";
  if (stdfs::is_symlink(path, code)) return "it is a link";
  if (const auto names = stdfs::hard_link_count(path, code); !code && names != 1) return "it has another name";
  const stdfs::path folder = stdfs::weakly_canonical(document.folder.empty() ? "." : document.folder, code);
  const stdfs::path relative = stdfs::weakly_canonical(path, code).lexically_relative(folder);
  if (relative.empty() || *relative.begin() == "..") return "it lies outside the scene's folder";
  return {};
}

}  // namespace

Result<SourceConsumer> SourceConsumer::plan(FileSystem& fs, const gltf::Document& document,
                                            const GeometryPlan& geometry, const std::string& output,
                                            std::vector<std::string>& warnings) {
  SourceConsumer consumer;
  consumer.fs_ = &fs;
  std::map<std::string, std::pair<uint32_t, uint32_t>> last_user;
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
          last_user[buffer.path] = {mesh, source.primitive};
          uint64_t& bytes = consumer.bytes_of_[buffer.path];
          bytes = std::max(bytes, buffer.path_offset + buffer.byte_length);
        }
      }
    }
  }
  for (const auto& [path, user] : last_user) {
    if (const std::string reason = reason_to_keep(path, document, output); !reason.empty()) {
      warnings.push_back(fmt::format("{} is not consumed: {}", path, reason));
    } else {
      consumer.parts_of_[user].push_back(path);
    }
  }
  return consumer;
}

Status SourceConsumer::source_done(const PrimitiveSource& source) {
  const auto found = parts_of_.find({source.mesh, source.primitive});
  if (found == parts_of_.end()) return {};
  for (const std::string& path : found->second) {
    SHOAL_ASSIGN_OR_RETURN(const uint64_t bytes, fs_->release(path, 0, bytes_of_[path]));
    released_bytes_ += bytes;
  }
  return {};
}

}  // namespace shoal
