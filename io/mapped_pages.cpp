#include "io/mapped_pages.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "io/file.h"

namespace shoal {
namespace {

constexpr uint64_t kReadableTailBytes = 64;

/// Bytes of a page with its tail, in whole blocks; a table is not there.
uint64_t place_bytes(const PageRecord& record) {
  if (record.kind == PageKind::kTable) return 0;
  return (record.raw_bytes + kReadableTailBytes + kPageAlignment - 1) / kPageAlignment * kPageAlignment;
}

Error system_error(const std::string& path, const char* what) {
  return Error{ErrorCode::kStorage, fmt::format("{}: {}: {}", path, what, std::strerror(errno))};
}

}  // namespace

uint64_t MappedPages::file_bytes(const PageFile& file) {
  uint64_t sum = 0;
  for (const PageRecord& record : file.records()) sum += place_bytes(record);
  return sum;
}

Status MappedPages::write(FileSystem& fs, const PageFile& file, const PageCheck& check, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(AtomicFile out, AtomicFile::create(fs, path));
  std::vector<std::byte> bytes;
  for (const PageRecord& record : file.records()) {
    if (record.kind == PageKind::kTable) continue;
    bytes.assign(place_bytes(record), std::byte{0});
    const std::span<std::byte> page(bytes.data(), record.raw_bytes);
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(file.read_page(record.id, page, &read_bytes));
    if (check) SHOAL_RETURN_IF_ERROR(check(record, page));
    SHOAL_RETURN_IF_ERROR(out.append(bytes));
  }
  return out.commit();
}

Result<std::unique_ptr<MappedPages>> MappedPages::open(const PageFile& file, const std::string& path,
                                                       MapAdvice advice) {
  const uint64_t expected = file_bytes(file);
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return Error{ErrorCode::kInput, fmt::format("{}: {}", path, std::strerror(errno))};
  struct stat found {};
  const bool stated = ::fstat(descriptor, &found) == 0;
  if (!stated || static_cast<uint64_t>(found.st_size) != expected || expected == 0) {
    ::close(descriptor);
    return Error{ErrorCode::kInput, fmt::format("{}: expected the {} bytes of all pages of {}, found {}", path,
                                                expected, file.path(), stated ? found.st_size : 0)};
  }
  ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
  void* data = ::mmap(nullptr, expected, PROT_READ, MAP_SHARED, descriptor, 0);
  ::close(descriptor);
  if (data == MAP_FAILED) return system_error(path, "cannot be mapped");
  std::unique_ptr<MappedPages> pages(new MappedPages(file, static_cast<const std::byte*>(data), expected));
  if (advice == MapAdvice::kRandom && ::madvise(data, expected, MADV_RANDOM) != 0) {
    return system_error(path, "cannot be advised");
  }
  return pages;
}

MappedPages::MappedPages(const PageFile& file, const std::byte* data, uint64_t size_bytes)
    : file_(file), data_(data), size_bytes_(size_bytes) {
  uint64_t offset = 0;
  for (const PageRecord& record : file.records()) {
    offsets_.push_back(offset);
    offset += place_bytes(record);
  }
}

MappedPages::~MappedPages() { ::munmap(const_cast<std::byte*>(data_), size_bytes_); }

std::span<const std::byte> MappedPages::bytes(PageId page) const {
  return {data_ + offsets_[page], file_.record(page).raw_bytes};
}

}  // namespace shoal
