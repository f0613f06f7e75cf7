#include "io/scratch_file.h"

#include <fmt/core.h>

namespace shoal {

Result<std::unique_ptr<ScratchFile>> ScratchFile::create(FileSystem& fs, const std::string& folder,
                                                         uint64_t bytes) {
  constexpr uint64_t kMostBytes = uint64_t{1} << 62;  // a file offset is signed
  if (bytes > kMostBytes) {
    return Error{ErrorCode::kStorage, fmt::format("cannot make a scratch file of {} bytes in {}: more than any file "
                                                  "holds", bytes, folder)};
  }
  const uint64_t rounded = align_up(bytes, kBlockBytes);
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.create_scratch(folder, rounded));
  return std::unique_ptr<ScratchFile>(new ScratchFile(std::move(file), rounded));
}

Status ScratchFile::write_at(uint64_t offset, std::span<const std::byte> bytes) {
  SHOAL_CHECK(holds(offset, bytes.size()) && offset % kBlockBytes == 0 && bytes.size() % kBlockBytes == 0);
  SHOAL_RETURN_IF_ERROR(file_->write_at(offset, bytes));
  written_bytes_.fetch_add(bytes.size(), std::memory_order_relaxed);
  return {};
}

Status ScratchFile::read_at(uint64_t offset, std::span<std::byte> out) {
  SHOAL_CHECK(holds(offset, out.size()));
  SHOAL_RETURN_IF_ERROR(file_->read_at(offset, out));
  read_bytes_.fetch_add(out.size(), std::memory_order_relaxed);
  return {};
}

void ScratchFile::release(uint64_t offset, uint64_t bytes) {
  SHOAL_CHECK(holds(offset, bytes));
  file_->release(offset, bytes);
}

}  // namespace shoal
