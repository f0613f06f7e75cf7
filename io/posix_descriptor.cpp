#include "io/posix_descriptor.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "io/aligned_buffer.h"

namespace shoal {
namespace {

constexpr uint64_t kStagingBytes = 256u << 10;  // of an unaligned direct read, at a time

}  // namespace

Descriptor::~Descriptor() {
  if (fd_ >= 0) ::close(fd_);
}

std::string reason(int error) {
  if (error == ENOSPC || error == EDQUOT) return "disk full";
  return std::generic_category().message(error);
}

int open_retrying(const char* path, int flags, mode_t mode) {
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

ssize_t read_direct(int fd, uint64_t offset, std::span<std::byte> out) {
  const bool aligned = offset % kBlockBytes == 0 && reinterpret_cast<uintptr_t>(out.data()) % kBlockBytes == 0;
  if (aligned && out.size() >= kBlockBytes) {
    return pread_retrying(fd, out.data(), align_down(out.size(), kBlockBytes), offset);
  }
  thread_local AlignedBuffer staging_memory;
  auto staging = staging_memory.reserve(kStagingBytes);
  if (!staging) return errno = ENOMEM, -1;
  const uint64_t block = align_down(offset, kBlockBytes);
  const uint64_t skip = offset - block;
  const uint64_t size =
      std::min(align_up(skip + std::min<uint64_t>(out.size(), kStagingBytes), kBlockBytes), kStagingBytes);
  const ssize_t got = pread_retrying(fd, staging.value().data(), size, block);
  if (got < 0) return got;
  if (static_cast<uint64_t>(got) <= skip) return 0;
  const uint64_t copied = std::min<uint64_t>(static_cast<uint64_t>(got) - skip, out.size());
  std::memcpy(out.data(), staging.value().data() + skip, copied);
  return static_cast<ssize_t>(copied);
}

bool write_all(int fd, uint64_t offset, std::span<const std::byte> bytes, uint64_t* written) {
  *written = 0;
  while (*written < bytes.size()) {
    const auto rest = bytes.subspan(*written);
    const ssize_t put = ::pwrite(fd, rest.data(), std::min<uint64_t>(rest.size(), kMaxTransferBytes),
                                 static_cast<off_t>(offset + *written));
    if (put < 0 && errno == EINTR) continue;
    if (put == 0) errno = EIO;  // stuck: a regular file takes at least a byte or says why not
    if (put <= 0) return false;
    *written += static_cast<uint64_t>(put);
  }
  return true;
}

void set_direct(int fd, bool direct) {
  const int flags = ::fcntl(fd, F_GETFL);
  ::fcntl(fd, F_SETFL, direct ? flags | O_DIRECT : flags & ~O_DIRECT);
}

uint64_t punch_hole(int fd, uint64_t offset, uint64_t bytes) {
  const uint64_t begin = align_up(offset, kBlockBytes), end = align_down(offset + bytes, kBlockBytes);
  if (begin >= end) return 0;
  while (::fallocate(fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(begin),
                     static_cast<off_t>(end - begin)) != 0) {
    if (errno != EINTR) return 0;
  }
  return end - begin;
}

}  // namespace shoal
