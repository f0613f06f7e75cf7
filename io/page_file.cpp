#include "io/page_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>

#include "io/page_codec.h"
#include "io/page_directory.h"
#include "io/page_format.h"

namespace shoal {
namespace {

// A thread keeps what a treelet needs; the room for larger pages (tables, read once) is given back.
constexpr uint64_t kKeptScratchBytes = 2u << 20;

Error damaged(const PageFile& file, const PageRecord& record, const std::string& what) {
  return {ErrorCode::kCorrupt,
          fmt::format("{} is damaged: page {} at offset {}: {}", file.path(), record.id, record.offset, what)};
}

Status check_payload(const PageFile& file, const PageRecord& record, std::span<const std::byte> payload) {
  const uint64_t found = page_checksum(record, payload);
  if (found == record.checksum) return {};
  return damaged(file, record, fmt::format("expected checksum {:016x}, found {:016x}", record.checksum, found));
}

Status decode(const PageFile& file, const PageRecord& record, std::span<const std::byte> payload,
              std::span<std::byte> out) {
  if (decompress_page(payload, out)) return {};
  return damaged(file, record,
                 fmt::format("expected {} bytes of lz4 that decode to {}, found other bytes", record.stored_bytes,
                             record.raw_bytes));
}

bool all_zero(std::span<const std::byte> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
}

bool same(const PageRecord& a, const PageRecord& b) { return std::memcmp(&a, &b, sizeof(PageRecord)) == 0; }

}  // namespace

PageFile::PageFile() = default;
PageFile::~PageFile() = default;

Result<std::unique_ptr<PageFile>> PageFile::open(FileSystem& fs, const std::string& path, ReadMode mode) {
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.open(path, mode));
  SHOAL_ASSIGN_OR_RETURN(PageDirectory directory, read_page_directory(*file));
  std::unique_ptr<PageFile> pages(new PageFile());
  pages->path_ = path;
  pages->file_bytes_ = file->size_bytes();
  pages->read_mode_ = mode;
  pages->records_ = std::move(directory.records);
  pages->tables_ = std::move(directory.tables);
  pages->file_ = std::move(file);
  return pages;
}

Status PageFile::read_page(PageId id, std::span<std::byte> out, uint64_t* read_bytes) const {
  SHOAL_CHECK(id < records_.size() && out.size() == records_[id].raw_bytes);
  const PageRecord& record = records_[id];
  *read_bytes = padded_bytes(record);
  if (record.codec == PageCodec::kRaw) {
    if (!out.empty()) SHOAL_RETURN_IF_ERROR(file_->read_at(record.offset, out));
    return check_payload(*this, record, out);
  }
  // Whole blocks into an aligned buffer: a direct read needs no copy.
  thread_local AlignedBuffer scratch;
  Status status = [&]() -> Status {
    SHOAL_ASSIGN_OR_RETURN(const auto block, scratch.reserve(padded_bytes(record)));
    SHOAL_RETURN_IF_ERROR(file_->read_at(record.offset, block));
    const auto payload = block.first(record.stored_bytes);
    SHOAL_RETURN_IF_ERROR(check_payload(*this, record, payload));
    return decode(*this, record, payload, out);
  }();
  scratch.shrink(kKeptScratchBytes);
  return status;
}

StoredRange PageFile::stored_range(PageId id) const { return {records_[id].offset, padded_bytes(records_[id])}; }

Status PageFile::decode_page(PageId id, std::span<const std::byte> stored, std::span<std::byte> out) const {
  const PageRecord& record = records_[id];
  SHOAL_CHECK(stored.size() >= record.stored_bytes && out.size() == record.raw_bytes);
  const auto payload = stored.first(record.stored_bytes);
  SHOAL_RETURN_IF_ERROR(check_payload(*this, record, payload));
  if (record.codec != PageCodec::kRaw) return decode(*this, record, payload, out);
  std::copy(payload.begin(), payload.end(), out.begin());
  return {};
}

const TableRange* PageFile::find_table(TableId table) const {
  const auto found =
      std::find_if(tables_.begin(), tables_.end(), [&](const TableRange& range) { return range.table == table; });
  return found == tables_.end() ? nullptr : &*found;
}

bool PageFile::has_table(TableId table) const { return find_table(table) != nullptr; }

Result<uint64_t> PageFile::table_bytes(TableId table, uint64_t limit_bytes) const {
  const TableRange* range = find_table(table);
  if (range == nullptr) {
    return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged: table {} is absent", path_, table)};
  }
  if (range->bytes > limit_bytes) {
    return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged: table {}: expected at most {} bytes, found {}",
                                                  path_, table, limit_bytes, range->bytes)};
  }
  return range->bytes;
}

Status PageFile::read_table_into(TableId table, std::span<std::byte> out) const {
  const TableRange* range = find_table(table);
  SHOAL_CHECK(range != nullptr && range->bytes == out.size());
  auto rest = out;
  for (PageId id = range->first_page; id < range->first_page + range->page_count; ++id) {
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(read_page(id, rest.first(records_[id].raw_bytes), &read_bytes));
    rest = rest.subspan(records_[id].raw_bytes);
  }
  return {};
}

Result<std::vector<std::byte>> PageFile::read_table(TableId table, uint64_t limit_bytes) const {
  SHOAL_ASSIGN_OR_RETURN(const uint64_t size, table_bytes(table, limit_bytes));
  std::vector<std::byte> bytes(size);
  SHOAL_RETURN_IF_ERROR(read_table_into(table, bytes));
  return bytes;
}

Status PageFile::verify() const {
  SHOAL_ASSIGN_OR_RETURN(const PageDirectory again, read_page_directory(*file_));
  if (!std::equal(records_.begin(), records_.end(), again.records.begin(), again.records.end(), same)) {
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{} is damaged: its directory changed since it was opened", path_)};
  }
  AlignedBuffer stored, decoded;
  for (const PageRecord& record : records_) {
    SHOAL_ASSIGN_OR_RETURN(const auto block, stored.reserve(padded_bytes(record)));
    if (!block.empty()) SHOAL_RETURN_IF_ERROR(file_->read_at(record.offset, block));
    const auto payload = block.first(record.stored_bytes);
    SHOAL_RETURN_IF_ERROR(check_payload(*this, record, payload));
    if (!all_zero(block.subspan(record.stored_bytes))) {
      return damaged(*this, record, "expected zero bytes after its end, found others");
    }
    if (record.codec == PageCodec::kRaw) continue;
    SHOAL_ASSIGN_OR_RETURN(const auto out, decoded.reserve(record.raw_bytes));
    SHOAL_RETURN_IF_ERROR(decode(*this, record, payload, out));
  }
  return {};
}

}  // namespace shoal
