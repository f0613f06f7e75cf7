#include <fcntl.h>
#include <fmt/core.h>

#include <cerrno>

#include "io/aligned_buffer.h"
#include "io/posix_descriptor.h"

namespace shoal {
namespace {

class PosixWritableFile final : public WritableFile {
 public:
  PosixWritableFile(std::string path, Descriptor fd, bool direct)
      : path_(std::move(path)), fd_(std::move(fd)), direct_(direct) {}

  const std::string& path() const override { return path_; }

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    const bool aligned = offset % kBlockBytes == 0 && reinterpret_cast<uintptr_t>(bytes.data()) % kBlockBytes == 0;
    const auto blocks = bytes.first(direct_ && aligned ? align_down(bytes.size(), kBlockBytes) : 0);
    uint64_t direct_bytes = 0;
    if (!write_all(fd_.get(), offset, blocks, &direct_bytes) && (errno != EINVAL || !direct_)) {
      return failure(offset, bytes.size(), direct_bytes);
    }
    // What is left is no whole block, or the file system took O_DIRECT at open but not for writing.
    const auto rest = bytes.subspan(direct_bytes);
    if (rest.empty()) return {};
    if (direct_) set_direct(fd_.get(), false);
    if (direct_bytes < blocks.size()) direct_ = false;
    uint64_t rest_bytes = 0;
    const bool ok = write_all(fd_.get(), offset + direct_bytes, rest, &rest_bytes);
    const int error = errno;
    if (direct_) set_direct(fd_.get(), true);
    errno = error;
    return ok ? Status() : failure(offset, bytes.size(), direct_bytes + rest_bytes);
  }

  Status sync() override {
    while (::fsync(fd_.get()) != 0) {
      if (errno == EINTR) continue;
      return Error{ErrorCode::kStorage, fmt::format("cannot sync {} to disk: {}", path_, reason(errno))};
    }
    return {};
  }

 private:
  Error failure(uint64_t offset, uint64_t total, uint64_t written) const {
    return {ErrorCode::kStorage, fmt::format("cannot write {} at offset {}: {} of {} bytes written ({})", path_,
                                             offset, written, total, reason(errno))};
  }

  const std::string path_;
  const Descriptor fd_;
  bool direct_;
};

}  // namespace

Result<std::unique_ptr<WritableFile>> create_posix_writable(const std::string& path, WriteMode mode) {
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC | O_NONBLOCK;
  bool direct = mode == WriteMode::kDirect;
  int fd = open_retrying(path.c_str(), direct ? kFlags | O_DIRECT : kFlags, 0666);
  if (fd < 0 && direct && errno == EINVAL) {
    direct = false;
    fd = open_retrying(path.c_str(), kFlags, 0666);
  }
  if (fd < 0) return Error{ErrorCode::kStorage, fmt::format("cannot create {}: {}", path, reason(errno))};
  return std::unique_ptr<WritableFile>(std::make_unique<PosixWritableFile>(path, Descriptor(fd), direct));
}

}  // namespace shoal
