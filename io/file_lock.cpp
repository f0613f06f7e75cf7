#include "io/file_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <thread>
#include <utility>

#include "io/posix_descriptor.h"

namespace shoal {
namespace {

constexpr std::chrono::milliseconds kBetweenTries{50};

bool lock_now(int descriptor) {
  int result = 0;
  do {
    result = ::flock(descriptor, LOCK_EX | LOCK_NB);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

/// The process that wrote its id into the file; 0 where none can be read.
long named_holder(int descriptor) {
  std::array<char, 32> text{};
  return pread_retrying(descriptor, reinterpret_cast<std::byte*>(text.data()), text.size() - 1, 0) > 0
             ? std::strtol(text.data(), nullptr, 10)
             : 0;
}

bool alive(long process) { return process > 0 && (::kill(static_cast<pid_t>(process), 0) == 0 || errno == EPERM); }

}  // namespace

Result<FileLock> FileLock::acquire(const std::string& path, std::chrono::milliseconds patience,
                                   const std::atomic<bool>* stop) {
  FileLock lock(open_retrying(path.c_str(), O_RDWR | O_CREAT, 0666));
  if (lock.descriptor_ < 0) return Error{ErrorCode::kStorage, fmt::format("cannot write {}: {}", path, reason(errno))};
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!lock_now(lock.descriptor_)) {
    if (errno != EWOULDBLOCK) {
      return Error{ErrorCode::kStorage, fmt::format("cannot lock {}: {}", path, reason(errno))};
    }
    const long holder = named_holder(lock.descriptor_);
    if (alive(holder)) {
      return Error{ErrorCode::kStorage, fmt::format("{} is locked: process {} is at work there", path, holder)};
    }
    if (stop != nullptr && stop->load()) return Error{ErrorCode::kStopped, "stopped"};
    if (std::chrono::steady_clock::now() >= end) {
      return Error{ErrorCode::kStorage, fmt::format("{} is locked: what process {} started is still at work there, though "
                                                    "that is gone", path, holder)};
    }
    std::this_thread::sleep_for(kBetweenTries);
  }
  const std::string text = fmt::format("{}\n", ::getpid());
  uint64_t written = 0;
  const bool ok = ::ftruncate(lock.descriptor_, 0) == 0 &&
                  write_all(lock.descriptor_, 0, std::as_bytes(std::span(text)), &written);
  if (!ok) return Error{ErrorCode::kStorage, fmt::format("cannot write {}: {}", path, reason(errno))};
  return lock;
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace shoal
