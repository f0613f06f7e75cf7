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
#include "io/posix_descriptor.h"

namespace shoal {
namespace {

class PosixReadableFile final : public ReadableFile {
 public:
  PosixReadableFile(std::string path, Descriptor fd, const struct stat& info, bool direct)
      : path_(std::move(path)),
        fd_(std::move(fd)),
        size_bytes_(static_cast<uint64_t>(info.st_size)),
        modified_ns_(info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec),
        direct_(direct) {}

  uint64_t size_bytes() const override { return size_bytes_; }
  int64_t modified_ns() const override { return modified_ns_; }
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
        set_direct(fd_.get(), false);
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
    return direct_.load(std::memory_order_relaxed) ? read_direct(fd_.get(), offset, out) : read_buffered(offset, out);
  }

  ssize_t read_buffered(uint64_t offset, std::span<std::byte> out) {
    return pread_retrying(fd_.get(), out.data(), out.size(), offset);
  }

  const std::string path_;
  const Descriptor fd_;
  const uint64_t size_bytes_;
  const int64_t modified_ns_;
  std::atomic<bool> direct_;
};

std::string directory_of(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

Status refuse_to_replace_what_is_no_file(const std::string& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || S_ISREG(info.st_mode) || S_ISLNK(info.st_mode)) return {};
  return Error{ErrorCode::kStorage, fmt::format("cannot replace {}: expected a regular file, found {}", path,
                                                S_ISDIR(info.st_mode) ? "a directory" : "a pipe or a device")};
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
    return std::unique_ptr<ReadableFile>(
        std::make_unique<PosixReadableFile>(path, std::move(descriptor), info, direct));
  }

  Result<std::unique_ptr<WritableFile>> create(const std::string& path, WriteMode mode) override {
    return create_posix_writable(path, mode);
  }

  Result<std::unique_ptr<NamelessFile>> create_scratch(const std::string& folder, uint64_t bytes) override {
    return create_posix_scratch(folder, bytes);
  }

  Result<uint64_t> release(const std::string& path, uint64_t offset, uint64_t bytes) override {
    const Descriptor fd(open_retrying(path.c_str(), O_WRONLY | O_NONBLOCK));
    if (fd.get() < 0) {
      return Error{ErrorCode::kStorage, fmt::format("cannot give back space of {}: {}", path, reason(errno))};
    }
    return punch_hole(fd.get(), offset, bytes);
  }

  Status rename(const std::string& from, const std::string& to) override {
    SHOAL_RETURN_IF_ERROR(refuse_to_replace_what_is_no_file(to));
    // Opened before the rename: what can fail should fail while the old file still has its name.
    const std::string directory = directory_of(to);
    const Descriptor fd(open_retrying(directory.c_str(), O_RDONLY | O_DIRECTORY));
    if (fd.get() < 0) {
      return Error{ErrorCode::kStorage, fmt::format("cannot open directory {}: {}", directory, reason(errno))};
    }
    if (::rename(from.c_str(), to.c_str()) != 0) {
      return Error{ErrorCode::kStorage, fmt::format("cannot rename {} to {}: {}", from, to, reason(errno))};
    }
    // Some file systems cannot sync a directory, and say so with EINVAL: there is nothing more to ask of them.
    if (::fsync(fd.get()) != 0 && errno != EINVAL && errno != ENOTSUP) {
      return Error{ErrorCode::kStorage,
                   fmt::format("{} is whole and in place, but may be lost in a power failure: cannot sync directory "
                               "{}: {}", to, directory, reason(errno))};
    }
    return {};
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
