// The fixed blocks of the `.shoal` container (docs/file_format.md is the document), shared by the writer and the
// reader. Little-endian, plain bytes.
//
//   Superblock (4096) | page 0, zero padding to 4096 | page 1, padding | ... | PageRecord[page_count] | Footer (64)
//
// Every byte is covered by exactly one checksum or must be zero, and nothing may lie between the parts.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "io/aligned_buffer.h"
#include "io/page_file.h"

namespace shoal {

static_assert(std::endian::native == std::endian::little, "pages and tables are stored as they are in memory");

/// CR LF and Ctrl-Z after the name: a transfer in text mode damages the first line, and is seen at once.
inline constexpr std::array<char, 8> kSuperblockMagic = {'S', 'H', 'O', 'A', 'L', '\r', '\n', '\x1a'};
inline constexpr std::array<char, 8> kFooterMagic = {'S', 'H', 'O', 'A', 'L', 'E', 'N', 'D'};
inline constexpr uint32_t kPageFileVersion = 1;
inline constexpr uint32_t kEndianMark = 0x01020304u;

struct Superblock {
  std::array<char, 8> magic = kSuperblockMagic;  //    0
  uint32_t version = kPageFileVersion;           //    8
  uint32_t endian_mark = kEndianMark;            //   12
  uint32_t page_alignment = kPageAlignment;      //   16
  uint32_t record_bytes = sizeof(PageRecord);    //   20
  std::byte reserved[4064] = {};                 //   24  zero
  uint64_t checksum = 0;                         // 4088  XXH3-64 of bytes 0..4087
};
static_assert(sizeof(Superblock) == kPageAlignment && offsetof(Superblock, checksum) == 4088);

struct Footer {
  std::array<char, 8> magic = kFooterMagic;  //  0
  uint32_t version = kPageFileVersion;       //  8
  uint32_t page_count = 0;                   // 12
  uint64_t directory_offset = 0;             // 16
  uint64_t directory_bytes = 0;              // 24  page_count * 40
  uint64_t directory_checksum = 0;           // 32  XXH3-64 of the directory
  uint64_t file_bytes = 0;                   // 40  the whole file, this footer included
  uint64_t superblock_checksum = 0;          // 48  Superblock::checksum: head and tail belong together
  uint64_t checksum = 0;                     // 56  XXH3-64 of bytes 0..55
};
static_assert(sizeof(Footer) == 64 && offsetof(Footer, checksum) == 56);

/// The room a page takes in the file.
inline uint64_t padded_bytes(const PageRecord& record) { return align_up(record.stored_bytes, kPageAlignment); }

}  // namespace shoal
