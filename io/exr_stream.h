// OpenEXR's streams over our files, so that every byte of a picture passes through the io floor. Included by
// exr_image.cpp only. Errors leave as Iex exceptions, with the Status kept beside.
#pragma once

#include <Iex.h>
#include <ImfIO.h>

#include <cstring>
#include <span>
#include <vector>

#include "io/file.h"

namespace shoal {

class ExrInput final : public Imf::IStream {
 public:
  explicit ExrInput(ReadableFile& file) : Imf::IStream(file.path().c_str()), file_(file) {}

  bool read(char out[], int n) override {
    const Status status =
        n < 0 ? Status(Error{ErrorCode::kInput, "a negative size"})
              : file_.read_at(offset_, std::as_writable_bytes(std::span(out, static_cast<size_t>(n))));
    if (!status.ok()) throw Iex::InputExc(status.error().message);
    offset_ += static_cast<uint64_t>(n);
    return offset_ < file_.size_bytes();
  }
  uint64_t tellg() override { return offset_; }
  void seekg(uint64_t offset) override { offset_ = offset; }

 private:
  ReadableFile& file_;
  uint64_t offset_ = 0;
};

/// Gathers small writes; flush() at the end.
class ExrOutput final : public Imf::OStream {
 public:
  ExrOutput(AtomicFile& file, const std::string& path) : Imf::OStream(path.c_str()), file_(file) {}

  void write(const char bytes[], int n) override {
    const auto piece = std::as_bytes(std::span(bytes, static_cast<size_t>(n)));
    pending_.insert(pending_.end(), piece.begin(), piece.end());
    if (pending_.size() >= kPendingBytes && !flush().ok()) throw Iex::IoExc(status_.error().message);
  }
  uint64_t tellp() override { return offset_ + pending_.size(); }
  void seekp(uint64_t offset) override {
    if (!flush().ok()) throw Iex::IoExc(status_.error().message);
    offset_ = offset;
  }
  /// The first error of any write.
  const Status& flush() {
    if (status_.ok()) status_ = file_.write_at(offset_, pending_);
    offset_ += pending_.size();
    pending_.clear();
    return status_;
  }
  const Status& status() const { return status_; }

 private:
  static constexpr size_t kPendingBytes = 1u << 18;
  AtomicFile& file_;
  uint64_t offset_ = 0;
  std::vector<std::byte> pending_;
  Status status_;
};

}  // namespace shoal
