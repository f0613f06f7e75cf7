// The file layer: every byte that enters or leaves the process passes through a FileSystem.
// Product code uses posix_file_system(); tests put a memory or a fault-injecting one in its place
// (tests/support/). Thread rule: a file may be read from many threads at once, written from one.
// Cost: one virtual call and one system call an operation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "io/result.h"

namespace shoal {

class ReadableFile {
 public:
  virtual ~ReadableFile() = default;
  /// Fills `out` from byte `offset`. Short reads and EINTR are retried; reaching the end of the file
  /// first fails. Fails with: kStorage (the message names file, offset, expected and found).
  virtual Status read_at(uint64_t offset, std::span<std::byte> out) = 0;
  virtual uint64_t size_bytes() const = 0;
  /// Time of modification when it was opened; 0 where there is no such time.
  virtual int64_t modified_ns() const { return 0; }
  virtual const std::string& path() const = 0;
  /// For reads that go on by themselves (io/async_reader); -1: read_at() is the only way.
  virtual int descriptor() const { return -1; }
};

class WritableFile {
 public:
  virtual ~WritableFile() = default;
  /// Fails with: kStorage (disk full is named as such).
  virtual Status write_at(uint64_t offset, std::span<const std::byte> bytes) = 0;
  virtual Status sync() = 0;
  virtual const std::string& path() const = 0;
};

/// A file that is written and read in turn and has no name: it is gone when it is let go, or the process ends.
/// Thread rule: any number of threads, on ranges that do not overlap. io/scratch_file.h is how it is used.
class NamelessFile {
 public:
  virtual ~NamelessFile() = default;
  /// Requires: offset and size are multiples of kBlockBytes. Fails with: kStorage.
  virtual Status write_at(uint64_t offset, std::span<const std::byte> bytes) = 0;
  /// Any range inside the file; what was never written reads as zero. Fails with: kStorage.
  virtual Status read_at(uint64_t offset, std::span<std::byte> out) = 0;
  /// Gives the space of whole blocks in the range back, as far as the file system can; they read as zero then or as
  /// they were.
  virtual void release(uint64_t offset, uint64_t bytes) = 0;
};

enum class ReadMode : uint8_t {
  kBuffered,  ///< through the operating system's cache
  kDirect,    ///< O_DIRECT where the file system takes it, else buffered; any offset and size may be asked
};

enum class WriteMode : uint8_t {
  kBuffered,  ///< through the operating system's cache
  kDirect,    ///< O_DIRECT for whole blocks at aligned addresses where the file system takes it, else buffered
};

class FileSystem {
 public:
  virtual ~FileSystem() = default;
  /// Fails with: kInput when the file does not exist or cannot be opened or is a directory.
  virtual Result<std::unique_ptr<ReadableFile>> open(const std::string& path, ReadMode mode) = 0;
  /// Creates or truncates. Fails with: kStorage.
  virtual Result<std::unique_ptr<WritableFile>> create(const std::string& path, WriteMode mode) = 0;
  /// A nameless file in `folder` with room for `bytes`, taken from the disk now. Direct where the file system takes
  /// it. Fails with: kStorage (folder missing or not writable, disk full: the message says how much was asked where).
  virtual Result<std::unique_ptr<NamelessFile>> create_scratch(const std::string& folder, uint64_t bytes) = 0;
  /// Gives the space of whole blocks in the range back (they read as zero from then on; the size stays) and says
  /// how many bytes that was: 0 where the file system cannot. Fails with: kStorage (cannot be opened for writing).
  virtual Result<uint64_t> release(const std::string& path, uint64_t offset, uint64_t bytes) = 0;
  /// Atomic replace, then fsync of the directory. Replaces regular files only. Fails with: kStorage; when only the
  /// directory could not be synced, the new name stands and the message says so.
  virtual Status rename(const std::string& from, const std::string& to) = 0;
  virtual Status remove(const std::string& path) = 0;
  /// Makes a folder and those above it, unless they are there. A file system without folders has nothing to do.
  /// Fails with: kStorage.
  virtual Status create_folder(const std::string& path);
};

FileSystem& posix_file_system();

class WriteBehind;

/// A file that appears under its final name whole or not at all: bytes go to a temporary name beside it
/// (`.NAME.tmp-PID-N`), commit() syncs, renames and syncs the directory; a destructor without commit()
/// removes the temporary.
class AtomicFile {
 public:
  /// kDirect: appends are gathered and written by a thread of its own (io/write_behind.h: kWriteBehindBytes of
  /// memory); their errors come back from a later call. Fails with: kStorage, kMemoryCap.
  static Result<AtomicFile> create(FileSystem& fs, const std::string& final_path,
                                   WriteMode mode = WriteMode::kBuffered);
  AtomicFile(AtomicFile&&) noexcept;
  AtomicFile& operator=(AtomicFile&&) noexcept;
  ~AtomicFile();

  /// Adds `bytes` at the end. Fails with: kStorage, also for what was gathered before (kDirect).
  Status append(std::span<const std::byte> bytes);
  /// Over what is there, or beyond the end: the gap reads as zero. Fails with: as append().
  Status write_at(uint64_t offset, std::span<const std::byte> bytes);
  uint64_t size_bytes() const { return size_bytes_; }
  /// Once, at the end. Fails with: kStorage; without its new name the temporary goes with the destructor.
  Status commit();

 private:
  AtomicFile(FileSystem& fs, std::unique_ptr<WritableFile> file, std::string final_path);
  FileSystem* fs_ = nullptr;
  std::unique_ptr<WritableFile> file_;
  std::unique_ptr<WriteBehind> behind_;  // null: buffered
  std::string final_path_;
  uint64_t size_bytes_ = 0;
};

/// The whole of a file, read directly. Fails with: kInput when larger than `limit_bytes`.
Result<std::string> read_whole_file(FileSystem& fs, const std::string& path, uint64_t limit_bytes);
/// Writes a small file atomically.
Status write_whole_file(FileSystem& fs, const std::string& path, std::span<const std::byte> bytes);

}  // namespace shoal
