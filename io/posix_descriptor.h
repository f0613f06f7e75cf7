// System calls on file descriptors as the posix file system uses them: retried, complete, and direct (O_DIRECT)
// where blocks allow. Included by io/posix_*.cpp only. Thread rule: plain functions; a descriptor has one owner.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "io/file.h"

namespace shoal {

inline constexpr uint64_t kMaxTransferBytes = 1u << 30;  ///< Linux moves at most 2^31 - 4096 bytes a call

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor();
  int get() const { return fd_; }

 private:
  int fd_;
};

/// What an errno means, in words; a full disk or quota is "disk full".
std::string reason(int error);
/// open() with O_CLOEXEC, until no signal interrupts it.
int open_retrying(const char* path, int flags, mode_t mode = 0);
ssize_t pread_retrying(int fd, std::byte* data, uint64_t size, uint64_t offset);
/// Reads at least one byte from `offset` on through an O_DIRECT descriptor, whatever the alignment: 0 at the end of
/// the file, -1 with errno. Whole blocks at aligned addresses are not copied.
ssize_t read_direct(int fd, uint64_t offset, std::span<std::byte> out);
/// Writes all of `bytes`. False with errno; `*written` says how far it came in either case.
bool write_all(int fd, uint64_t offset, std::span<const std::byte> bytes, uint64_t* written);
/// Switches O_DIRECT of an open descriptor.
void set_direct(int fd, bool direct);
/// Gives back the space of whole blocks in the range; how many bytes that was, 0 where it cannot be.
uint64_t punch_hole(int fd, uint64_t offset, uint64_t bytes);

Result<std::unique_ptr<WritableFile>> create_posix_writable(const std::string& path, WriteMode mode);
Result<std::unique_ptr<NamelessFile>> create_posix_scratch(const std::string& folder, uint64_t bytes);

}  // namespace shoal
