#include "tests/support/faulty_file_system.h"

#include "io/aligned_buffer.h"

namespace shoal {
namespace {

Error failure(Fault fault, const std::string& path) {
  return {ErrorCode::kStorage, path + (fault == Fault::kDiskFull ? ": disk full" : ": Input/output error")};
}

}  // namespace

void FaultyFileSystem::arm(Fault fault, uint64_t call, bool lasting) {
  fault_ = fault;
  at_call_ = call;
  lasting_ = lasting;
  calls_ = 0;
}

Fault FaultyFileSystem::next(Call call) {
  const Fault fault = fault_;
  bool applies = false;
  switch (fault) {
    case Fault::kNone:
      break;
    case Fault::kIoError:
      applies = true;
      break;
    case Fault::kDiskFull:
      applies = call == Call::kCreate || call == Call::kWrite || call == Call::kSync ||
                call == Call::kRename;
      break;
    case Fault::kShortRead:
    case Fault::kBitFlip:
      applies = call == Call::kRead;
      break;
  }
  if (!applies) return Fault::kNone;
  const uint64_t number = calls_.fetch_add(1);
  return number == at_call_ || (lasting_ && number > at_call_) ? fault : Fault::kNone;
}

template <class File>
Status FaultyFileSystem::read(File& file, const std::string& name, uint64_t offset, std::span<std::byte> out) {
  const Fault fault = next(Call::kRead);
  const std::string place = name + " at offset " + std::to_string(offset);
  if (fault == Fault::kIoError) return failure(fault, place);
  if (fault == Fault::kShortRead) {
    SHOAL_RETURN_IF_ERROR(file.read_at(offset, out.first(out.size() / 2)));
    return Error{ErrorCode::kStorage, place + ": short read"};
  }
  SHOAL_RETURN_IF_ERROR(file.read_at(offset, out));
  if (fault == Fault::kBitFlip && !out.empty()) out[out.size() / 3] ^= std::byte{0x10};
  return {};
}

template <class File>
Status FaultyFileSystem::write(File& file, const std::string& name, uint64_t offset,
                               std::span<const std::byte> bytes) {
  const Fault fault = next(Call::kWrite);
  if (fault == Fault::kNone) return file.write_at(offset, bytes);
  const uint64_t half = bytes.size() / 2;
  const uint64_t done = bytes.size() % kBlockBytes == 0 ? align_down(half, kBlockBytes) : half;
  SHOAL_RETURN_IF_ERROR(file.write_at(offset, bytes.first(done)));
  return failure(fault, name + " at offset " + std::to_string(offset));
}

class FaultyFileSystem::Reader final : public ReadableFile {
 public:
  Reader(FaultyFileSystem& fs, std::unique_ptr<ReadableFile> base) : fs_(fs), base_(std::move(base)) {}

  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    return fs_.read(*base_, path(), offset, out);
  }
  uint64_t size_bytes() const override { return base_->size_bytes(); }
  int64_t modified_ns() const override { return base_->modified_ns(); }
  const std::string& path() const override { return base_->path(); }

 private:
  FaultyFileSystem& fs_;
  const std::unique_ptr<ReadableFile> base_;
};

class FaultyFileSystem::Writer final : public WritableFile {
 public:
  Writer(FaultyFileSystem& fs, std::unique_ptr<WritableFile> base) : fs_(fs), base_(std::move(base)) {}

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    return fs_.write(*base_, path(), offset, bytes);
  }
  Status sync() override {
    const Fault fault = fs_.next(Call::kSync);
    if (fault != Fault::kNone) return failure(fault, path());
    return base_->sync();
  }
  const std::string& path() const override { return base_->path(); }

 private:
  FaultyFileSystem& fs_;
  const std::unique_ptr<WritableFile> base_;
};

class FaultyFileSystem::Scratch final : public NamelessFile {
 public:
  Scratch(FaultyFileSystem& fs, std::string name, std::unique_ptr<NamelessFile> base)
      : fs_(fs), name_(std::move(name)), base_(std::move(base)) {
    ++fs_.scratch_files_;
  }
  ~Scratch() override { --fs_.scratch_files_; }

  Status write_at(uint64_t offset, std::span<const std::byte> bytes) override {
    return fs_.write(*base_, name_, offset, bytes);
  }
  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    return fs_.read(*base_, name_, offset, out);
  }
  void release(uint64_t offset, uint64_t bytes) override { base_->release(offset, bytes); }

 private:
  FaultyFileSystem& fs_;
  const std::string name_;
  const std::unique_ptr<NamelessFile> base_;
};

Result<std::unique_ptr<ReadableFile>> FaultyFileSystem::open(const std::string& path, ReadMode mode) {
  if (const Fault fault = next(Call::kOpen); fault != Fault::kNone) return failure(fault, path);
  SHOAL_ASSIGN_OR_RETURN(auto file, base_.open(path, mode));
  return std::unique_ptr<ReadableFile>(std::make_unique<Reader>(*this, std::move(file)));
}

Result<std::unique_ptr<WritableFile>> FaultyFileSystem::create(const std::string& path, WriteMode mode) {
  if (const Fault fault = next(Call::kCreate); fault != Fault::kNone) return failure(fault, path);
  SHOAL_ASSIGN_OR_RETURN(auto file, base_.create(path, mode));
  return std::unique_ptr<WritableFile>(std::make_unique<Writer>(*this, std::move(file)));
}

Result<std::unique_ptr<NamelessFile>> FaultyFileSystem::create_scratch(const std::string& folder, uint64_t bytes) {
  const std::string name = "scratch file in " + folder;
  if (const Fault fault = next(Call::kCreate); fault != Fault::kNone) return failure(fault, name);
  SHOAL_ASSIGN_OR_RETURN(auto file, base_.create_scratch(folder, bytes));
  return std::unique_ptr<NamelessFile>(std::make_unique<Scratch>(*this, name, std::move(file)));
}

Result<uint64_t> FaultyFileSystem::release(const std::string& path, uint64_t offset, uint64_t bytes) {
  return base_.release(path, offset, bytes);
}

Status FaultyFileSystem::rename(const std::string& from, const std::string& to) {
  if (const Fault fault = next(Call::kRename); fault != Fault::kNone) return failure(fault, from);
  return base_.rename(from, to);
}

Status FaultyFileSystem::create_folder(const std::string& path) {
  if (const Fault fault = next(Call::kCreate); fault != Fault::kNone) return failure(fault, path);
  return base_.create_folder(path);
}

}  // namespace shoal
