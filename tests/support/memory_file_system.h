// A FileSystem in memory: tests write, read, look at and damage files without a disk. Thread rule: any number of
// threads; a file being written is seen by its readers as it was when they opened it.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "io/file.h"

namespace shoal {

class MemoryFileSystem final : public FileSystem {
 public:
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path, ReadMode mode) override;
  Result<std::unique_ptr<WritableFile>> create(const std::string& path, WriteMode mode) override;
  Result<std::unique_ptr<NamelessFile>> create_scratch(const std::string& folder, uint64_t bytes) override;
  Result<uint64_t> release(const std::string& path, uint64_t offset, uint64_t bytes) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status remove(const std::string& path) override;

  /// Puts a whole file there, or replaces it; its time of modification is another each time.
  void put(const std::string& path, std::vector<std::byte> bytes);
  void put(const std::string& path, const std::string& text);
  bool exists(const std::string& path) const;
  /// Empty when there is no such file.
  std::vector<std::byte> contents(const std::string& path) const;
  /// Names of all files, sorted.
  std::vector<std::string> names() const;

 private:
  using Bytes = std::vector<std::byte>;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Bytes>> files_;
  std::map<std::string, int64_t> modified_;
  int64_t clock_ = 0;

  class Reader;
  class Writer;
  class Scratch;
};

}  // namespace shoal
