// A FileSystem that fails on purpose: it passes calls on to another one, and harms the n-th call that the chosen
// fault applies to. remove() and release() are never harmed: they are how the code under test cleans up. Thread rule: any number of
// threads.
#pragma once

#include <atomic>
#include <cstdint>

#include "io/file.h"

namespace shoal {

enum class Fault {
  kNone,
  kIoError,    ///< any call: fails with EIO; a write leaves half of its bytes behind
  kDiskFull,   ///< create (a folder too), write, sync, rename: fails with ENOSPC; a write leaves half of its bytes behind
  kShortRead,  ///< read: fills half and fails
  kBitFlip,    ///< read: one bit of what comes back is wrong, and nobody says so
};

class FaultyFileSystem final : public FileSystem {
 public:
  explicit FaultyFileSystem(FileSystem& base) : base_(base) {}

  /// Harms the call number `call` (from 0) among those the fault applies to, counted from now; with `lasting`
  /// all later ones too.
  void arm(Fault fault, uint64_t call, bool lasting = false);
  /// Calls that the armed fault could have harmed so far.
  uint64_t calls() const { return calls_.load(); }
  /// Scratch files that are held now.
  uint64_t scratch_files() const { return scratch_files_.load(); }

  Result<std::unique_ptr<ReadableFile>> open(const std::string& path, ReadMode mode) override;
  Result<std::unique_ptr<WritableFile>> create(const std::string& path, WriteMode mode) override;
  Result<std::unique_ptr<NamelessFile>> create_scratch(const std::string& folder, uint64_t bytes) override;
  Result<uint64_t> release(const std::string& path, uint64_t offset, uint64_t bytes) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status remove(const std::string& path) override { return base_.remove(path); }
  Status create_folder(const std::string& path) override;

 private:
  class Reader;
  class Writer;
  class Scratch;
  enum class Call { kOpen, kCreate, kRead, kWrite, kSync, kRename };
  /// The fault to do to this call, or kNone.
  Fault next(Call call);
  template <class File>
  Status read(File& file, const std::string& name, uint64_t offset, std::span<std::byte> out);
  template <class File>
  Status write(File& file, const std::string& name, uint64_t offset, std::span<const std::byte> bytes);

  FileSystem& base_;
  std::atomic<Fault> fault_{Fault::kNone};
  std::atomic<uint64_t> at_call_{0};
  std::atomic<uint64_t> calls_{0};
  std::atomic<bool> lasting_{false};
  std::atomic<uint64_t> scratch_files_{0};
};

}  // namespace shoal
