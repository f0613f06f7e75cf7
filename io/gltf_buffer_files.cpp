#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "io/gltf_accessor.h"

namespace shoal::gltf {

BufferFiles::BufferFiles(FileSystem& fs, const Document& document, size_t max_open_files)
    : fs_(&fs), document_(&document), max_open_files_(max_open_files), files_(document.buffers.size()) {}

Result<ReadableFile*> BufferFiles::open(uint32_t buffer) {
  if (files_[buffer]) return files_[buffer].get();
  const Buffer& source = document_->buffers[buffer];
  if (open_buffers_.size() >= max_open_files_) {
    files_[open_buffers_.front()].reset();
    open_buffers_.erase(open_buffers_.begin());
  }
  SHOAL_ASSIGN_OR_RETURN(auto file, fs_->open(source.path, ReadMode::kDirect));
  const uint64_t size = file->size_bytes();
  if (source.path_offset > size || source.byte_length > size - source.path_offset) {
    return Error{
        ErrorCode::kInput,
        fmt::format("{}: buffers[{}].byteLength: expected at most the {} bytes of {}, found {}", document_->path,
                    buffer, size - std::min(size, source.path_offset), source.path, source.byte_length)};
  }
  files_[buffer] = std::move(file);
  open_buffers_.push_back(buffer);
  return files_[buffer].get();
}

Status BufferFiles::check(uint32_t buffer) {
  if (document_->buffers[buffer].path.empty()) return {};
  SHOAL_RETURN_IF_ERROR(open(buffer));
  return {};
}

Status BufferFiles::read(uint32_t buffer, uint64_t offset, std::span<std::byte> out) {
  const Buffer& source = document_->buffers[buffer];
  if (offset > source.byte_length || out.size() > source.byte_length - offset) {
    return Error{ErrorCode::kInput, fmt::format("{}: buffers[{}]: expected bytes inside {}, found {} from {}",
                                                document_->path, buffer, source.byte_length, out.size(), offset)};
  }
  if (source.placeholder) {
    return Error{ErrorCode::kInput, fmt::format("{}: buffers[{}]: expected bytes, found a fallback of "
                                                "EXT_meshopt_compression", document_->path, buffer)};
  }
  read_bytes_ += out.size();
  if (source.scratch) return source.scratch->read_at(offset, out);
  if (source.path.empty()) {
    if (!out.empty()) std::memcpy(out.data(), source.embedded.data() + offset, out.size());
    return {};
  }
  SHOAL_ASSIGN_OR_RETURN(ReadableFile* const file, open(buffer));
  return file->read_at(source.path_offset + offset, out);
}

}  // namespace shoal::gltf
