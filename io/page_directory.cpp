#include "io/page_directory.h"

#include <fmt/core.h>

#include <algorithm>
#include <bitset>

#include "io/page_codec.h"
#include "io/page_format.h"

namespace shoal {
namespace {

constexpr uint64_t kSmallestFileBytes = sizeof(Superblock) + sizeof(Footer);
constexpr uint64_t kTableIdCount = 65536;

template <class T>
Error wrong(const ReadableFile& file, uint64_t offset, const char* what, const T& expected, const T& found) {
  return {ErrorCode::kCorrupt, fmt::format("{} is damaged at offset {}: {}: expected {}, found {}", file.path(),
                                           offset, what, expected, found)};
}

template <class T>
Status expect(const ReadableFile& file, uint64_t offset, const char* what, T expected, T found) {
  if (expected == found) return {};
  return wrong(file, offset, what, expected, found);
}

template <class T>
Status read_block(ReadableFile& file, uint64_t offset, T& block) {
  return file.read_at(offset, std::as_writable_bytes(std::span(&block, 1)));
}

template <class T>
uint64_t checksum_of(const T& block) {
  return hash_bytes(std::as_bytes(std::span(&block, 1)).first(offsetof(T, checksum)));
}

/// Tells a stranger's file (kInput) from one of ours that was cut off (kCorrupt).
Status check_length(ReadableFile& file) {
  if (file.size_bytes() >= kSmallestFileBytes) return {};
  std::array<char, 8> magic{};
  const size_t size = std::min<uint64_t>(file.size_bytes(), magic.size());
  SHOAL_RETURN_IF_ERROR(file.read_at(0, std::as_writable_bytes(std::span(magic.data(), size))));
  if (!std::equal(magic.begin(), magic.begin() + size, kSuperblockMagic.begin())) {
    return Error{ErrorCode::kInput, fmt::format("{} is not a .shoal file", file.path())};
  }
  return Error{ErrorCode::kCorrupt, fmt::format("{} is cut off: expected at least {} bytes, found {}", file.path(),
                                                kSmallestFileBytes, file.size_bytes())};
}

Status check_superblock(ReadableFile& file, const Superblock& block) {
  SHOAL_RETURN_IF_ERROR(expect(file, offsetof(Superblock, checksum), "checksum of the superblock",
                               checksum_of(block), block.checksum));
  if (block.version != kPageFileVersion) {
    return Error{ErrorCode::kInput, fmt::format("{} has format version {}: this program reads version {}",
                                                file.path(), block.version, kPageFileVersion)};
  }
  SHOAL_RETURN_IF_ERROR(
      expect(file, offsetof(Superblock, endian_mark), "byte order", kEndianMark, block.endian_mark));
  SHOAL_RETURN_IF_ERROR(
      expect(file, offsetof(Superblock, page_alignment), "page alignment", kPageAlignment, block.page_alignment));
  SHOAL_RETURN_IF_ERROR(expect(file, offsetof(Superblock, record_bytes), "bytes of a directory record",
                               static_cast<uint32_t>(sizeof(PageRecord)), block.record_bytes));
  const bool zero = std::all_of(std::begin(block.reserved), std::end(block.reserved),
                                [](std::byte b) { return b == std::byte{0}; });
  return expect(file, offsetof(Superblock, reserved), "reserved bytes that are zero", true, zero);
}

Status check_footer(ReadableFile& file, const Footer& footer, const Superblock& superblock) {
  const uint64_t size = file.size_bytes();
  const uint64_t place = size - sizeof(Footer);
  if (footer.magic != kFooterMagic) {
    return Error{ErrorCode::kCorrupt, fmt::format("{} has no footer at offset {}: it was cut off or never finished",
                                                  file.path(), place)};
  }
  SHOAL_RETURN_IF_ERROR(expect(file, place, "checksum of the footer", checksum_of(footer), footer.checksum));
  SHOAL_RETURN_IF_ERROR(expect(file, place, "format version in the footer", superblock.version, footer.version));
  SHOAL_RETURN_IF_ERROR(expect(file, place, "size of the file", footer.file_bytes, size));
  SHOAL_RETURN_IF_ERROR(
      expect(file, place, "checksum of the superblock", superblock.checksum, footer.superblock_checksum));
  // Each page takes a block of the file, except the one empty page of an empty table.
  const uint64_t most_pages = std::min<uint64_t>(size / kPageAlignment + kTableIdCount, kNoPage);
  if (footer.page_count > most_pages) {
    return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged at offset {}: expected at most {} pages, found {}",
                                                  file.path(), place, most_pages, footer.page_count)};
  }
  const uint64_t directory_bytes = uint64_t{footer.page_count} * sizeof(PageRecord);
  SHOAL_RETURN_IF_ERROR(expect(file, place, "bytes of the directory", directory_bytes, footer.directory_bytes));
  if (directory_bytes > size - kSmallestFileBytes) {
    return wrong(file, place, "bytes of the directory, at most", size - kSmallestFileBytes, directory_bytes);
  }
  return expect(file, place, "offset of the directory", place - directory_bytes, footer.directory_offset);
}

/// Takes the records one by one and holds each against what must come next.
class DirectoryBuilder {
 public:
  DirectoryBuilder(const ReadableFile& file, const Footer& footer) : file_(file), footer_(footer) {}

  Status add(const PageRecord& record) {
    const uint64_t place = footer_.directory_offset + directory_.records.size() * sizeof(PageRecord);
    SHOAL_RETURN_IF_ERROR(
        expect(file_, place, "page id", static_cast<uint32_t>(directory_.records.size()), record.id));
    SHOAL_RETURN_IF_ERROR(expect(file_, place, "reserved bytes of a record", uint64_t{0}, record.reserved));
    SHOAL_RETURN_IF_ERROR(expect(file_, place, "offset of a page", next_offset_, record.offset));
    SHOAL_RETURN_IF_ERROR(check_sizes(record, place));
    if (padded_bytes(record) > footer_.directory_offset - next_offset_) {
      return wrong(file_, place, "bytes of a page, at most", footer_.directory_offset - next_offset_,
                   padded_bytes(record));
    }
    next_offset_ += padded_bytes(record);
    SHOAL_RETURN_IF_ERROR(add_to_table(record, place));
    reserve_for_next();
    directory_.records.push_back(record);
    return {};
  }

  Result<PageDirectory> finish() {
    SHOAL_RETURN_IF_ERROR(
        expect(file_, footer_.directory_offset, "end of the last page", footer_.directory_offset, next_offset_));
    return std::move(directory_);
  }

 private:
  Status check_sizes(const PageRecord& r, uint64_t place) const {
    const auto kind = static_cast<unsigned>(r.kind);
    if (kind < static_cast<unsigned>(PageKind::kTable) || kind > static_cast<unsigned>(PageKind::kTexture)) {
      return wrong(file_, place, "kind of a page, at most", static_cast<unsigned>(PageKind::kTexture), kind);
    }
    if (r.raw_bytes > kMaxPageBytes)
      return wrong(file_, place, "decoded bytes, at most", kMaxPageBytes, r.raw_bytes);
    if (r.kind != PageKind::kTable) {
      SHOAL_RETURN_IF_ERROR(expect(file_, place, "table of a page that is none", TableId{0}, r.table));
      if (r.raw_bytes == 0) return wrong(file_, place, "decoded bytes, at least", 1u, r.raw_bytes);
    }
    if (r.codec == PageCodec::kRaw) {
      return expect(file_, place, "stored bytes of a raw page", r.raw_bytes, r.stored_bytes);
    }
    if (r.codec != PageCodec::kLz4) {
      return wrong(file_, place, "codec, at most", static_cast<unsigned>(PageCodec::kLz4),
                   static_cast<unsigned>(r.codec));
    }
    if (r.stored_bytes >= r.raw_bytes) {
      return wrong(file_, place, "stored bytes of an lz4 page, below", r.raw_bytes, r.stored_bytes);
    }
    if (r.raw_bytes > kMaxLz4Ratio * r.stored_bytes) {
      return wrong(file_, place, "decoded bytes of an lz4 page, at most", kMaxLz4Ratio * r.stored_bytes,
                   uint64_t{r.raw_bytes});
    }
    return {};
  }

  /// A table is one run of pages, full but for the last; an empty one is a single page of no bytes.
  Status add_to_table(const PageRecord& r, uint64_t place) {
    if (r.kind != PageKind::kTable) return {};
    if (r.raw_bytes > kTablePageBytes) {
      return wrong(file_, place, "bytes of a table's page, at most", kTablePageBytes, r.raw_bytes);
    }
    auto& tables = directory_.tables;
    const bool goes_on = !tables.empty() && tables.back().table == r.table &&
                         tables.back().first_page + tables.back().page_count == r.id;
    if (!goes_on) {
      if (seen_.test(r.table)) {
        return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged at offset {}: table {} is stored twice",
                                                      file_.path(), place, r.table)};
      }
      seen_.set(r.table);
      tables.push_back({r.table, r.id, 1, r.raw_bytes});
      return {};
    }
    SHOAL_RETURN_IF_ERROR(expect(file_, place, "bytes of the table's page before", kTablePageBytes,
                                 directory_.records.back().raw_bytes));
    if (r.raw_bytes == 0) return wrong(file_, place, "bytes of a table's page, at least", 1u, r.raw_bytes);
    tables.back().page_count += 1;
    tables.back().bytes += r.raw_bytes;
    return {};
  }

  /// Grows as valid records come, never on the word of the footer alone, and ends exactly full.
  void reserve_for_next() {
    auto& records = directory_.records;
    if (records.size() < records.capacity()) return;
    records.reserve(std::min<size_t>(footer_.page_count, std::max<size_t>(4096, 2 * records.size())));
  }

  const ReadableFile& file_;
  const Footer& footer_;
  PageDirectory directory_;
  std::bitset<kTableIdCount> seen_;
  uint64_t next_offset_ = sizeof(Superblock);
};

}  // namespace

Result<PageDirectory> read_page_directory(ReadableFile& file) {
  SHOAL_RETURN_IF_ERROR(check_length(file));
  Superblock superblock;
  Footer footer;
  SHOAL_RETURN_IF_ERROR(read_block(file, 0, superblock));
  SHOAL_RETURN_IF_ERROR(read_block(file, file.size_bytes() - sizeof(Footer), footer));
  if (superblock.magic != kSuperblockMagic && footer.magic != kFooterMagic) {
    return Error{ErrorCode::kInput, fmt::format("{} is not a .shoal file", file.path())};
  }
  SHOAL_RETURN_IF_ERROR(
      expect(file, 0, "the name of the format at the start", true, superblock.magic == kSuperblockMagic));
  SHOAL_RETURN_IF_ERROR(check_superblock(file, superblock));
  SHOAL_RETURN_IF_ERROR(check_footer(file, footer, superblock));

  DirectoryBuilder builder(file, footer);
  PieceHash hash;
  std::vector<PageRecord> piece(std::min<uint32_t>(footer.page_count, 4096));
  for (uint32_t done = 0; done < footer.page_count;) {
    const auto records = std::span(piece).first(std::min<size_t>(piece.size(), footer.page_count - done));
    const uint64_t place = footer.directory_offset + uint64_t{done} * sizeof(PageRecord);
    SHOAL_RETURN_IF_ERROR(file.read_at(place, std::as_writable_bytes(records)));
    hash.add(std::as_bytes(records));
    for (const PageRecord& record : records) SHOAL_RETURN_IF_ERROR(builder.add(record));
    done += static_cast<uint32_t>(records.size());
  }
  SHOAL_RETURN_IF_ERROR(
      expect(file, footer.directory_offset, "checksum of the directory", footer.directory_checksum, hash.value()));
  return builder.finish();
}

}  // namespace shoal
