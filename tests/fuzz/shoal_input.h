// .shoal files as fuzzers like them. A paged file is mostly padding, and every byte of it is under a checksum:
// mutations of it are refused at the door. An input is one of
//   'S'HOAL...   the file itself
//   'R' file     the file, whose checksums are made right before it is opened
//   'P' parts    what the file holds, without padding: a sound container is put around it
// A part is a PartHead and `stored_bytes` bytes; up to `bytes` it goes on with the last four of them, again and
// again, as tiles of textures do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/page_file.h"

namespace shoal::fuzz {

struct PartHead {  // 8 bytes
  uint8_t kind;    ///< PageKind
  uint8_t table;   ///< TableId, of kTable
  uint16_t stored_bytes;
  uint32_t bytes;
};
static_assert(sizeof(PartHead) == 8);

/// The bytes of the file that an input stands for; never fails: what is nonsense gives a file that is.
std::vector<std::byte> shoal_file_of(std::span<const std::byte> input);
/// An input of the third kind. Fails with: kInput (a page is too large; those of small scenes are not).
Result<std::vector<std::byte>> parts_of(const PageFile& file);

}  // namespace shoal::fuzz
