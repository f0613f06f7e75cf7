#include <fcntl.h>
#include <fmt/core.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "io/aligned_buffer.h"
#include "io/posix_descriptor.h"

namespace shoal {
namespace {

constexpr uint64_t kCopyBytes = 256u << 10;  // of a write from an unaligned address, at a time

class PosixScratchFile final : public NamelessFile {
 public:
  PosixScratchFile(std::string folder, Descriptor fd, bool direct)
      : folder_(std::move(folder)), fd_(std::move(fd)), direct_(direct) {}

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    if (bytes.empty() || !direct_.load() || reinterpret_cast<uintptr_t>(bytes.data()) % kBlockBytes == 0) {
      return write_aligned(offset, bytes);
    }
    thread_local AlignedBuffer copy_memory;
    SHOAL_ASSIGN_OR_RETURN(const auto copy, copy_memory.reserve(kCopyBytes));
    while (!bytes.empty()) {
      const auto piece = copy.first(std::min<uint64_t>(bytes.size(), kCopyBytes));
      std::memcpy(piece.data(), bytes.data(), piece.size());
      SHOAL_RETURN_IF_ERROR(write_aligned(offset, piece));
      offset += piece.size();
      bytes = bytes.subspan(piece.size());
    }
    return {};
  }

  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    const uint64_t begin = offset, total = out.size();
    while (!out.empty()) {
      const ssize_t got = direct_.load() ? read_direct(fd_.get(), offset, out)
                                         : pread_retrying(fd_.get(), out.data(), out.size(), offset);
      if (got < 0 && errno == EINVAL && leave_direct()) continue;
      if (got <= 0) return failure("read", begin, total, offset - begin, got == 0 ? "end of file" : reason(errno));
      offset += static_cast<uint64_t>(got);
      out = out.subspan(static_cast<size_t>(got));
    }
    return {};
  }

  void release(uint64_t offset, uint64_t bytes) override { punch_hole(fd_.get(), offset, bytes); }

 private:
  Status write_aligned(uint64_t offset, std::span<const std::byte> bytes) {
    uint64_t written = 0;
    while (!write_all(fd_.get(), offset, bytes, &written)) {
      if (errno != EINVAL || !leave_direct()) return failure("write", offset, bytes.size(), written, reason(errno));
    }
    return {};
  }

  /// The file system took O_DIRECT at open but not for moving bytes: go on through the system's cache. True when
  /// that may help; another thread may have done it already.
  bool leave_direct() {
    if (refusals_.fetch_add(1) > kRefusals) return false;
    direct_.store(false);
    set_direct(fd_.get(), false);
    return true;
  }

  Error failure(const char* verb, uint64_t offset, uint64_t total, uint64_t moved, const std::string& why) const {
    return {ErrorCode::kStorage, fmt::format("cannot {} the scratch file in {} at offset {}: {} of {} bytes done ({})",
                                             verb, folder_, offset, moved, total, why)};
  }

  static constexpr uint32_t kRefusals = 1024;  // more than threads: a file that refuses buffered too must end
  const std::string folder_;
  const Descriptor fd_;
  std::atomic<bool> direct_;
  std::atomic<uint32_t> refusals_{0};
};

/// O_TMPFILE never gives the file a name; where it is not known, a name stands for an instant. -1 with errno.
int open_nameless(const std::string& folder, int extra_flags) {
  const int fd = open_retrying(folder.c_str(), O_TMPFILE | O_EXCL | O_RDWR | extra_flags, 0600);
  if (fd >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)) return fd;
  static std::atomic<uint64_t> count{0};
  const std::string path = fmt::format("{}/.shoal-scratch-{}-{}", folder, ::getpid(), count++);
  const int named = open_retrying(path.c_str(), O_CREAT | O_EXCL | O_RDWR | extra_flags, 0600);
  const int error = errno;
  ::unlink(path.c_str());  // also when O_DIRECT was refused: the name is made before that is found out
  errno = error;
  return named;
}

/// Takes the room now; false with errno. Asks for the free space first: a file system may take all that is left before
/// it finds out that this is not enough, and others would meet a full disk meanwhile.
bool take_room(int fd, uint64_t bytes) {
  if (bytes == 0) return true;
  struct statvfs info {};
  if (::fstatvfs(fd, &info) == 0 && uint64_t{info.f_bavail} * info.f_frsize < bytes) return errno = ENOSPC, false;
  while (::fallocate(fd, 0, 0, static_cast<off_t>(bytes)) != 0) {
    if (errno == EINTR) continue;
    if (errno != EOPNOTSUPP && errno != ENOSYS) return false;
    return ::ftruncate(fd, static_cast<off_t>(bytes)) == 0;
  }
  return true;
}

}  // namespace

Result<std::unique_ptr<NamelessFile>> create_posix_scratch(const std::string& folder, uint64_t bytes) {
  const std::string place = folder.empty() ? "." : folder;
  bool direct = true;
  int fd = open_nameless(place, O_DIRECT);
  if (fd < 0 && errno == EINVAL) {
    direct = false;
    fd = open_nameless(place, 0);
  }
  Descriptor descriptor(fd);
  if (fd < 0 || !take_room(fd, bytes)) {
    return Error{ErrorCode::kStorage,
                 fmt::format("cannot make a scratch file of {} bytes in {}: {}", bytes, place, reason(errno))};
  }
  return std::unique_ptr<NamelessFile>(std::make_unique<PosixScratchFile>(place, std::move(descriptor), direct));
}

}  // namespace shoal
