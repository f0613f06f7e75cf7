#include <fmt/core.h>

#include <cstring>
#include <optional>
#include <unordered_set>

#include "io/page_codec.h"
#include "io/page_format.h"

namespace shoal {

struct PageFileWriter::State {
  State(AtomicFile out, std::string final_path) : file(std::move(out)), path(std::move(final_path)) {}

  Status write_superblock();
  Result<PageId> append(PageKind kind, TableId table, std::span<const std::byte> bytes);
  Status write_page(const PageRecord& record, std::span<const std::byte> payload);
  Status write_directory_and_footer();
  /// A writer that failed once stays failed: the pages after the failure would be in the wrong place.
  Status remember(Status status) {
    if (!status.ok() && !failure) failure = status.error();
    return status;
  }
  Status refused() const { return failure ? Status(*failure) : Status(); }

  AtomicFile file;
  std::string path;
  std::vector<PageRecord> records;
  std::unordered_set<TableId> tables;
  AlignedBuffer compressed;
  AlignedBuffer padded;
  uint64_t superblock_checksum = 0;
  std::optional<Error> failure;
};

Status PageFileWriter::State::write_superblock() {
  Superblock superblock;
  const auto bytes = std::as_bytes(std::span(&superblock, 1));
  superblock.checksum = superblock_checksum = hash_bytes(bytes.first(offsetof(Superblock, checksum)));
  return file.append(bytes);
}

Result<PageId> PageFileWriter::State::append(PageKind kind, TableId table, std::span<const std::byte> bytes) {
  SHOAL_RETURN_IF_ERROR(refused());
  if (records.size() >= kNoPage) {
    return Error{ErrorCode::kStorage, fmt::format("{} has too many pages: expected fewer than {}", path, kNoPage)};
  }
  PageRecord record{};
  record.offset = file.size_bytes();
  record.raw_bytes = static_cast<uint32_t>(bytes.size());
  record.stored_bytes = record.raw_bytes;
  record.id = static_cast<PageId>(records.size());
  record.table = table;
  record.kind = kind;
  record.codec = PageCodec::kRaw;
  SHOAL_ASSIGN_OR_RETURN(const auto out, compressed.reserve(compressed_bound_bytes(bytes.size())));
  if (const uint32_t stored = compress_page(bytes, out); stored != 0) {
    record.codec = PageCodec::kLz4;
    record.stored_bytes = stored;
    bytes = out.first(stored);
  }
  record.checksum = page_checksum(record, bytes);
  SHOAL_RETURN_IF_ERROR(remember(write_page(record, bytes)));
  records.push_back(record);
  return record.id;
}

Status PageFileWriter::State::write_page(const PageRecord& record, std::span<const std::byte> payload) {
  if (payload.empty()) return {};
  SHOAL_ASSIGN_OR_RETURN(const auto block, padded.reserve(padded_bytes(record)));
  std::memcpy(block.data(), payload.data(), payload.size());
  std::memset(block.data() + payload.size(), 0, block.size() - payload.size());
  return file.append(block);
}

Status PageFileWriter::State::write_directory_and_footer() {
  const auto directory = std::as_bytes(std::span(records));
  Footer footer;
  footer.page_count = static_cast<uint32_t>(records.size());
  footer.directory_offset = file.size_bytes();
  footer.directory_bytes = directory.size();
  footer.directory_checksum = hash_bytes(directory);
  footer.file_bytes = footer.directory_offset + directory.size() + sizeof(Footer);
  footer.superblock_checksum = superblock_checksum;
  const auto bytes = std::as_bytes(std::span(&footer, 1));
  footer.checksum = hash_bytes(bytes.first(offsetof(Footer, checksum)));
  SHOAL_RETURN_IF_ERROR(file.append(directory));
  return file.append(bytes);
}

Result<PageFileWriter> PageFileWriter::create(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(fs, path, WriteMode::kDirect));
  auto state = std::make_unique<State>(std::move(file), path);
  SHOAL_RETURN_IF_ERROR(state->write_superblock());
  return PageFileWriter(std::move(state));
}

PageFileWriter::PageFileWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
PageFileWriter::PageFileWriter(PageFileWriter&&) noexcept = default;
PageFileWriter& PageFileWriter::operator=(PageFileWriter&&) noexcept = default;
PageFileWriter::~PageFileWriter() = default;

Result<PageId> PageFileWriter::append(PageKind kind, std::span<const std::byte> bytes) {
  SHOAL_CHECK(kind != PageKind::kTable && !bytes.empty() && bytes.size() <= kMaxPageBytes);
  return state_->append(kind, 0, bytes);
}

Status PageFileWriter::append_table(TableId table, std::span<const std::byte> bytes) {
  SHOAL_CHECK(state_->tables.insert(table).second);
  do {  // once for an empty table too: a page of no bytes says that the table is there
    const auto piece = bytes.first(std::min<size_t>(bytes.size(), kTablePageBytes));
    SHOAL_RETURN_IF_ERROR(state_->append(PageKind::kTable, table, piece));
    bytes = bytes.subspan(piece.size());
  } while (!bytes.empty());
  return {};
}

uint64_t PageFileWriter::bytes_written() const { return state_->file.size_bytes(); }
uint32_t PageFileWriter::page_count() const { return static_cast<uint32_t>(state_->records.size()); }

Status PageFileWriter::finish() {
  SHOAL_RETURN_IF_ERROR(state_->refused());
  SHOAL_RETURN_IF_ERROR(state_->remember(state_->write_directory_and_footer()));
  return state_->remember(state_->file.commit());
}

}  // namespace shoal
