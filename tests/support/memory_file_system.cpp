#include "tests/support/memory_file_system.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>

#include "io/aligned_buffer.h"

namespace shoal {
namespace {

/// Zeroes the whole blocks in the range, as a hole punched would; how many bytes that was.
uint64_t zero_blocks(std::vector<std::byte>& file, uint64_t offset, uint64_t bytes) {
  const uint64_t begin = align_up(offset, kBlockBytes);
  const uint64_t end = align_down(std::min<uint64_t>(offset + bytes, file.size()), kBlockBytes);
  if (begin >= end) return 0;
  std::memset(file.data() + begin, 0, end - begin);
  return end - begin;
}

}  // namespace

class MemoryFileSystem::Reader final : public ReadableFile {
 public:
  Reader(std::string path, Bytes bytes, int64_t modified_ns)
      : path_(std::move(path)), bytes_(std::move(bytes)), modified_ns_(modified_ns) {}

  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    const uint64_t found = offset < bytes_.size() ? bytes_.size() - offset : 0;
    if (out.size() > found) {
      return Error{ErrorCode::kStorage, fmt::format("cannot read {} at offset {}: expected {} bytes, found {}",
                                                    path_, offset, out.size(), found)};
    }
    if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
    return {};
  }
  uint64_t size_bytes() const override { return bytes_.size(); }
  int64_t modified_ns() const override { return modified_ns_; }
  const std::string& path() const override { return path_; }

 private:
  const std::string path_;
  const Bytes bytes_;
  const int64_t modified_ns_;
};

class MemoryFileSystem::Writer final : public WritableFile {
 public:
  Writer(MemoryFileSystem& fs, std::string path, std::shared_ptr<Bytes> bytes)
      : fs_(fs), path_(std::move(path)), bytes_(std::move(bytes)) {}

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    const std::lock_guard lock(fs_.mutex_);
    if (bytes_->size() < offset + bytes.size()) bytes_->resize(offset + bytes.size());
    if (!bytes.empty()) std::memcpy(bytes_->data() + offset, bytes.data(), bytes.size());
    return {};
  }
  Status sync() override { return {}; }
  const std::string& path() const override { return path_; }

 private:
  MemoryFileSystem& fs_;
  const std::string path_;
  const std::shared_ptr<Bytes> bytes_;
};

class MemoryFileSystem::Scratch final : public NamelessFile {
 public:
  explicit Scratch(uint64_t bytes) : bytes_(bytes) {}

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    if (!bytes.empty()) std::memcpy(bytes_.data() + offset, bytes.data(), bytes.size());
    return {};
  }
  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
    return {};
  }
  void release(uint64_t offset, uint64_t bytes) override { zero_blocks(bytes_, offset, bytes); }

 private:
  Bytes bytes_;
};

Result<std::unique_ptr<ReadableFile>> MemoryFileSystem::open(const std::string& path, ReadMode) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(path);
  if (found == files_.end()) return Error{ErrorCode::kInput, "cannot open " + path + ": no such file"};
  return std::unique_ptr<ReadableFile>(std::make_unique<Reader>(path, *found->second, modified_[path]));
}

Result<std::unique_ptr<WritableFile>> MemoryFileSystem::create(const std::string& path, WriteMode) {
  const std::lock_guard lock(mutex_);
  auto bytes = std::make_shared<Bytes>();
  files_[path] = bytes;
  return std::unique_ptr<WritableFile>(std::make_unique<Writer>(*this, path, std::move(bytes)));
}

Result<std::unique_ptr<NamelessFile>> MemoryFileSystem::create_scratch(const std::string&, uint64_t bytes) {
  return std::unique_ptr<NamelessFile>(std::make_unique<Scratch>(bytes));
}

Result<uint64_t> MemoryFileSystem::release(const std::string& path, uint64_t offset, uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(path);
  if (found == files_.end()) return Error{ErrorCode::kStorage, "cannot give back space of " + path + ": no such file"};
  return zero_blocks(*found->second, offset, bytes);
}

Status MemoryFileSystem::rename(const std::string& from, const std::string& to) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(from);
  if (found == files_.end()) return Error{ErrorCode::kStorage, "cannot rename " + from + ": no such file"};
  const auto bytes = found->second;
  files_.erase(found);
  files_[to] = bytes;
  return {};
}

Status MemoryFileSystem::remove(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (files_.erase(path) == 0) return Error{ErrorCode::kStorage, "cannot remove " + path + ": no such file"};
  return {};
}

void MemoryFileSystem::put(const std::string& path, std::vector<std::byte> bytes) {
  const std::lock_guard lock(mutex_);
  files_[path] = std::make_shared<Bytes>(std::move(bytes));
  modified_[path] = ++clock_;
}

void MemoryFileSystem::put(const std::string& path, const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text.data(), text.size()));
  put(path, std::vector<std::byte>(bytes.begin(), bytes.end()));
}

bool MemoryFileSystem::exists(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  return files_.contains(path);
}

std::vector<std::byte> MemoryFileSystem::contents(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(path);
  return found == files_.end() ? std::vector<std::byte>() : *found->second;
}

std::vector<std::string> MemoryFileSystem::names() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> all;
  for (const auto& [name, bytes] : files_) all.push_back(name);
  return all;
}

}  // namespace shoal
