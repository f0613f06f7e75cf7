#include "tests/fuzz/shoal_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "io/page_codec.h"
#include "io/page_format.h"

namespace shoal::fuzz {
namespace {

using Bytes = std::vector<std::byte>;

constexpr size_t kMostParts = 256;
constexpr uint32_t kMostPartBytes = 1u << 18;
constexpr size_t kWord = 4;  // that a part goes on with

/// Of a plain struct.
template <class T>
std::span<const std::byte> raw(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

void append(Bytes& bytes, std::span<const std::byte> more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

void append_padded(Bytes& bytes, std::span<const std::byte> more) {
  append(bytes, more);
  bytes.resize(align_up(bytes.size(), kPageAlignment));
}

/// Directory and footer after the pages, checksums of all.
void finish(Bytes& bytes, std::vector<PageRecord>& records) {
  Superblock superblock;
  superblock.checksum = hash_bytes(raw(superblock).first(offsetof(Superblock, checksum)));
  std::memcpy(bytes.data(), &superblock, sizeof(superblock));
  for (PageRecord& r : records) r.checksum = page_checksum(r, std::span(bytes).subspan(r.offset, r.stored_bytes));
  Footer footer;
  footer.page_count = static_cast<uint32_t>(records.size());
  footer.directory_offset = bytes.size();
  footer.directory_bytes = records.size() * sizeof(PageRecord);
  footer.directory_checksum = hash_bytes(std::as_bytes(std::span(records)));
  footer.file_bytes = bytes.size() + footer.directory_bytes + sizeof(Footer);
  footer.superblock_checksum = superblock.checksum;
  footer.checksum = hash_bytes(raw(footer).first(offsetof(Footer, checksum)));
  append(bytes, std::as_bytes(std::span(records)));
  append(bytes, raw(footer));
}

Bytes file_of_parts(std::span<const std::byte> parts) {
  Bytes bytes(sizeof(Superblock));
  std::vector<PageRecord> records;
  while (parts.size() >= sizeof(PartHead) && records.size() < kMostParts) {
    PartHead head;
    std::memcpy(&head, parts.data(), sizeof(head));
    parts = parts.subspan(sizeof(head));
    const size_t stored = std::min<size_t>(head.stored_bytes, parts.size());
    Bytes page(parts.begin(), parts.begin() + static_cast<ptrdiff_t>(stored));
    parts = parts.subspan(stored);
    page.resize(std::clamp<size_t>(head.bytes, stored, kMostPartBytes));
    for (size_t i = stored; i < page.size() && stored >= kWord; ++i) page[i] = page[i - kWord];
    PageRecord record{};
    record.offset = bytes.size();
    record.raw_bytes = record.stored_bytes = static_cast<uint32_t>(page.size());
    record.id = static_cast<uint32_t>(records.size());
    record.table = head.kind == static_cast<uint8_t>(PageKind::kTable) ? head.table : 0;
    record.kind = static_cast<PageKind>(head.kind);
    records.push_back(record);
    append_padded(bytes, page);
  }
  finish(bytes, records);
  return bytes;
}

/// Where the directory lies, if the footer names a place inside the file.
std::vector<PageRecord> directory_of(const Bytes& bytes, const Footer& footer) {
  const uint64_t end = bytes.size() - sizeof(Footer);
  if (footer.directory_offset > end) return {};
  const uint64_t count =
      std::min<uint64_t>(footer.page_count, (end - footer.directory_offset) / sizeof(PageRecord));
  std::vector<PageRecord> records(count);
  if (count > 0) std::memcpy(records.data(), bytes.data() + footer.directory_offset, count * sizeof(PageRecord));
  return records;
}

void repair_checksums(Bytes& bytes) {
  if (bytes.size() < sizeof(Superblock) + sizeof(Footer)) return;
  Superblock superblock;
  std::memcpy(&superblock, bytes.data(), sizeof(superblock));
  superblock.checksum = hash_bytes(raw(superblock).first(offsetof(Superblock, checksum)));
  std::memcpy(bytes.data(), &superblock, sizeof(superblock));
  Footer footer;
  std::byte* const tail = bytes.data() + bytes.size() - sizeof(footer);
  std::memcpy(&footer, tail, sizeof(footer));
  std::vector<PageRecord> records = directory_of(bytes, footer);
  for (PageRecord& r : records) {
    if (r.offset > bytes.size() || r.stored_bytes > bytes.size() - r.offset) continue;
    r.checksum = page_checksum(r, std::span(bytes).subspan(r.offset, r.stored_bytes));
  }
  if (!records.empty()) {
    std::memcpy(bytes.data() + footer.directory_offset, records.data(), records.size() * sizeof(PageRecord));
  }
  footer.directory_checksum = hash_bytes(std::as_bytes(std::span(records)));
  footer.superblock_checksum = superblock.checksum;
  footer.checksum = hash_bytes(raw(footer).first(offsetof(Footer, checksum)));
  std::memcpy(tail, &footer, sizeof(footer));
}

}  // namespace

std::vector<std::byte> shoal_file_of(std::span<const std::byte> input) {
  if (input.empty()) return {};
  if (input[0] == std::byte{'P'}) return file_of_parts(input.subspan(1));
  const bool repaired = input[0] == std::byte{'R'};
  if (repaired) input = input.subspan(1);
  Bytes bytes(input.begin(), input.end());
  if (repaired) repair_checksums(bytes);
  return bytes;
}

Result<std::vector<std::byte>> parts_of(const PageFile& file) {
  Bytes input(1, std::byte{'P'});
  for (const PageRecord& record : file.records()) {
    Bytes page(record.raw_bytes);
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(file.read_page(record.id, page, &read_bytes));
    while (page.size() > kWord && page.back() == page[page.size() - 1 - kWord]) page.pop_back();
    if (page.size() > 0xffff || record.raw_bytes > kMostPartBytes) {
      return Error{ErrorCode::kInput,
                   fmt::format("page {} of {} bytes is too large for a part", record.id, page.size())};
    }
    const PartHead head{static_cast<uint8_t>(record.kind), static_cast<uint8_t>(record.table),
                        static_cast<uint16_t>(page.size()), record.raw_bytes};
    append(input, raw(head));
    append(input, page);
  }
  return input;
}

}  // namespace shoal::fuzz
