#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>

#include "io/file.h"
#include "io/write_behind.h"

namespace shoal {
namespace {

/// `.NAME.tmp-PID-N` beside the final name: the same file system, so that rename is atomic; hidden, so that a
/// listing of a directory being written shows whole files only.
std::string temporary_path(const std::string& final_path) {
  static std::atomic<uint64_t> count{0};
  const size_t slash = final_path.rfind('/');
  const size_t name = slash == std::string::npos ? 0 : slash + 1;
  return fmt::format("{}.{}.tmp-{}-{}", final_path.substr(0, name), final_path.substr(name), ::getpid(), count++);
}

}  // namespace

Result<AtomicFile> AtomicFile::create(FileSystem& fs, const std::string& final_path, WriteMode mode) {
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.create(temporary_path(final_path), mode));
  AtomicFile atomic(fs, std::move(file), final_path);
  if (mode == WriteMode::kDirect) {
    SHOAL_ASSIGN_OR_RETURN(atomic.behind_, WriteBehind::create(*atomic.file_));
  }
  return atomic;
}

AtomicFile::AtomicFile(FileSystem& fs, std::unique_ptr<WritableFile> file, std::string final_path)
    : fs_(&fs), file_(std::move(file)), final_path_(std::move(final_path)) {}

AtomicFile::AtomicFile(AtomicFile&&) noexcept = default;

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
  std::swap(fs_, other.fs_);
  std::swap(file_, other.file_);
  std::swap(behind_, other.behind_);
  std::swap(final_path_, other.final_path_);
  std::swap(size_bytes_, other.size_bytes_);
  return *this;
}

AtomicFile::~AtomicFile() {
  if (!file_) return;
  const std::string path = file_->path();
  behind_.reset();
  file_.reset();
  // Nothing can be done when even this fails; the caller already has the first error.
  (void)fs_->remove(path);
}

Status AtomicFile::append(std::span<const std::byte> bytes) { return write_at(size_bytes_, bytes); }

Status AtomicFile::write_at(uint64_t offset, std::span<const std::byte> bytes) {
  if (!behind_) {
    SHOAL_RETURN_IF_ERROR(file_->write_at(offset, bytes));
  } else {
    static constexpr std::byte kZeros[kBlockBytes] = {};
    for (; size_bytes_ < offset; size_bytes_ += std::min(offset - size_bytes_, kBlockBytes)) {
      SHOAL_RETURN_IF_ERROR(behind_->append(std::span(kZeros).first(std::min(offset - size_bytes_, kBlockBytes))));
    }
    const auto there = bytes.first(std::min<uint64_t>(bytes.size(), size_bytes_ - offset));
    if (!there.empty()) SHOAL_RETURN_IF_ERROR(behind_->overwrite(offset, there));
    SHOAL_RETURN_IF_ERROR(behind_->append(bytes.subspan(there.size())));
  }
  size_bytes_ = std::max(size_bytes_, offset + bytes.size());
  return {};
}

Status AtomicFile::commit() {
  if (behind_) SHOAL_RETURN_IF_ERROR(behind_->flush());
  SHOAL_RETURN_IF_ERROR(file_->sync());
  const std::string temporary = file_->path();
  const Status renamed = fs_->rename(temporary, final_path_);
  if (renamed.ok()) {
    behind_.reset();
    file_.reset();
  }
  return renamed;
}

Result<std::string> read_whole_file(FileSystem& fs, const std::string& path, uint64_t limit_bytes) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kDirect));
  if (file->size_bytes() > limit_bytes) {
    return Error{ErrorCode::kInput, fmt::format("{} is too large: expected at most {} bytes, found {}", path,
                                                limit_bytes, file->size_bytes())};
  }
  std::string text(file->size_bytes(), '\0');
  SHOAL_RETURN_IF_ERROR(file->read_at(0, std::as_writable_bytes(std::span(text.data(), text.size()))));
  return text;
}

Status write_whole_file(FileSystem& fs, const std::string& path, std::span<const std::byte> bytes) {
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(fs, path));
  SHOAL_RETURN_IF_ERROR(file.append(bytes));
  return file.commit();
}

}  // namespace shoal
