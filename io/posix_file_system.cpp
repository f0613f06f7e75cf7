#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "io/aligned_buffer.h"
#include "io/file.h"

namespace shoal {
namespace {

constexpr uint64_t kStagingBytes = 256u << 10;    // of an unaligned direct read, at a time
constexpr uint64_t kMaxTransferBytes = 1u << 30;  // Linux moves at most 2^31 - 4096 bytes a call

std::string reason(int error) {
  if (error == ENOSPC || error == EDQUOT) return "disk full";
  return std::generic_category().message(error);
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

int open_retrying(const char* path, int flags, mode_t mode = 0) {
  for (;;) {
    const int fd = ::open(path, flags | O_CLOEXEC, mode);
    if (fd >= 0 || errno != EINTR) return fd;
  }
}

ssize_t pread_retrying(int fd, std::byte* data, uint64_t size, uint64_t offset) {
  for (;;) {
    const ssize_t got = ::pread(fd, data, std::min(size, kMaxTransferBytes), static_cast<off_t>(offset));
    if (got >= 0 || errno != EINTR) return got;
  }
}

class PosixReadableFile final : public ReadableFile {
 public:
  PosixReadableFile(std::string path, Descriptor fd, uint64_t size_bytes, bool direct)
      : path_(std::move(path)), fd_(std::move(fd)), size_bytes_(size_bytes), direct_(direct) {}

  uint64_t size_bytes() const override { return size_bytes_; }
  const std::string& path() const override { return path_; }
  int descriptor() const override { return fd_.get(); }

  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    const uint64_t begin = offset;
    const uint64_t total = out.size();
    if (offset > size_bytes_ || total > size_bytes_ - offset) {
      return ended(begin, total, offset < size_bytes_ ? size_bytes_ - offset : 0);
    }
    while (!out.empty()) {
      ssize_t got = read_some(offset, out);
      if (got < 0 && errno == EINVAL && direct_.exchange(false, std::memory_order_relaxed)) {
        // The file system took O_DIRECT at open but not for reading: go on through the system's cache.
        ::fcntl(fd_.get(), F_SETFL, ::fcntl(fd_.get(), F_GETFL) & ~O_DIRECT);
        continue;
      }
      // Another thread may have switched direct reads off while this one was refused.
      if (got < 0 && errno == EINVAL && !direct_.load(std::memory_order_relaxed)) got = read_buffered(offset, out);
      if (got < 0) {
        return Error{ErrorCode::kStorage,
                     fmt::format("cannot read {} at offset {}: expected {} bytes, found {} ({})", path_, begin,
                                 total, offset - begin, reason(errno))};
      }
      if (got == 0) return ended(begin, total, offset - begin);
      offset += static_cast<uint64_t>(got);
      out = out.subspan(static_cast<size_t>(got));
    }
    return {};
  }

 private:
  Error ended(uint64_t offset, uint64_t expected, uint64_t found) const {
    return {ErrorCode::kStorage,
            fmt::format("cannot read {} at offset {}: expected {} bytes, found {} (end of file)", path_, offset,
                        expected, found)};
  }

  ssize_t read_some(uint64_t offset, std::span<std::byte> out) {
    return direct_.load(std::memory_order_relaxed) ? read_direct(offset, out) : read_buffered(offset, out);
  }

  ssize_t read_buffered(uint64_t offset, std::span<std::byte> out) {
    return pread_retrying(fd_.get(), out.data(), out.size(), offset);
  }

  /// At least one byte from `offset` on, 0 at the end of the file, -1 with errno.
  ssize_t read_direct(uint64_t offset, std::span<std::byte> out) {
    const bool aligned = offset % kBlockBytes == 0 && reinterpret_cast<uintptr_t>(out.data()) % kBlockBytes == 0;
    if (aligned && out.size() >= kBlockBytes) {
      return pread_retrying(fd_.get(), out.data(), align_down(out.size(), kBlockBytes), offset);
    }
    thread_local AlignedBuffer staging_memory;
    auto staging = staging_memory.reserve(kStagingBytes);
    if (!staging) return errno = ENOMEM, -1;
    const uint64_t block = align_down(offset, kBlockBytes);
    const uint64_t skip = offset - block;
    const uint64_t size =
        std::min(align_up(skip + std::min<uint64_t>(out.size(), kStagingBytes), kBlockBytes), kStagingBytes);
    const ssize_t got = pread_retrying(fd_.get(), staging.value().data(), size, block);
    if (got < 0) return got;
    if (static_cast<uint64_t>(got) <= skip) return 0;
    const uint64_t copied = std::min<uint64_t>(static_cast<uint64_t>(got) - skip, out.size());
    std::memcpy(out.data(), staging.value().data() + skip, copied);
    return static_cast<ssize_t>(copied);
  }

  const std::string path_;
  const Descriptor fd_;
  const uint64_t size_bytes_;
  std::atomic<bool> direct_;
};

class PosixWritableFile final : public WritableFile {
 public:
  PosixWritableFile(std::string path, Descriptor fd) : path_(std::move(path)), fd_(std::move(fd)) {}

  const std::string& path() const override { return path_; }

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    const uint64_t begin = offset;
    const uint64_t total = bytes.size();
    while (!bytes.empty()) {
      const ssize_t put = ::pwrite(fd_.get(), bytes.data(), std::min<uint64_t>(bytes.size(), kMaxTransferBytes),
                                   static_cast<off_t>(offset));
      if (put < 0 && errno == EINTR) continue;
      if (put <= 0) {
        return Error{ErrorCode::kStorage,
                     fmt::format("cannot write {} at offset {}: {} of {} bytes written ({})", path_, begin,
                                 offset - begin, total, put < 0 ? reason(errno) : "stuck")};
      }
      offset += static_cast<uint64_t>(put);
      bytes = bytes.subspan(static_cast<size_t>(put));
    }
    return {};
  }

  Status sync() override {
    while (::fsync(fd_.get()) != 0) {
      if (errno == EINTR) continue;
      return Error{ErrorCode::kStorage, fmt::format("cannot sync {} to disk: {}", path_, reason(errno))};
    }
    return {};
  }

 private:
  const std::string path_;
  const Descriptor fd_;
};

Status sync_directory_of(const std::string& path) {
  const size_t slash = path.rfind('/');
  const std::string directory = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
  const Descriptor fd(open_retrying(directory.c_str(), O_RDONLY | O_DIRECTORY));
  // Some file systems cannot sync a directory, and say so with EINVAL: there is nothing more to ask of them.
  if (fd.get() < 0 || (::fsync(fd.get()) != 0 && errno != EINVAL && errno != ENOTSUP)) {
    return Error{ErrorCode::kStorage, fmt::format("cannot sync directory {}: {}", directory, reason(errno))};
  }
  return {};
}

class PosixFileSystem final : public FileSystem {
 public:
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path, ReadMode mode) override {
    // O_NONBLOCK: opening a FIFO without a writer would wait for ever; regular files ignore it.
    constexpr int kFlags = O_RDONLY | O_NONBLOCK;
    bool direct = mode == ReadMode::kDirect;
    int fd = open_retrying(path.c_str(), direct ? kFlags | O_DIRECT : kFlags);
    if (fd < 0 && direct && errno == EINVAL) {
      direct = false;
      fd = open_retrying(path.c_str(), kFlags);
    }
    if (fd < 0) return Error{ErrorCode::kInput, fmt::format("cannot open {}: {}", path, reason(errno))};
    Descriptor descriptor(fd);
    struct stat info {};
    if (::fstat(fd, &info) != 0) {
      return Error{ErrorCode::kInput, fmt::format("cannot read the size of {}: {}", path, reason(errno))};
    }
    if (!S_ISREG(info.st_mode)) {
      return Error{ErrorCode::kInput, fmt::format("cannot open {}: expected a regular file, found {}", path,
                                                  S_ISDIR(info.st_mode) ? "a directory" : "a pipe or a device")};
    }
    return std::unique_ptr<ReadableFile>(std::make_unique<PosixReadableFile>(
        path, std::move(descriptor), static_cast<uint64_t>(info.st_size), direct));
  }

  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    Descriptor fd(open_retrying(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NONBLOCK, 0666));
    if (fd.get() < 0) return Error{ErrorCode::kStorage, fmt::format("cannot create {}: {}", path, reason(errno))};
    return std::unique_ptr<WritableFile>(std::make_unique<PosixWritableFile>(path, std::move(fd)));
  }

  Status rename(const std::string& from, const std::string& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) {
      return Error{ErrorCode::kStorage, fmt::format("cannot rename {} to {}: {}", from, to, reason(errno))};
    }
    return sync_directory_of(to);
  }

  Status remove(const std::string& path) override {
    if (::unlink(path.c_str()) != 0) {
      return Error{ErrorCode::kStorage, fmt::format("cannot remove {}: {}", path, reason(errno))};
    }
    return {};
  }

  Status create_folder(const std::string& path) override {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (!error && std::filesystem::is_directory(path, error)) return {};
    return Error{ErrorCode::kStorage, fmt::format("cannot make folder {}: {}", path,
                                                  error ? error.message() : "expected a folder, found a file")};
  }
};

}  // namespace

Status FileSystem::create_folder(const std::string&) { return {}; }

FileSystem& posix_file_system() {
  static PosixFileSystem file_system;
  return file_system;
}

}  // namespace shoal
