// Packing and checking of one page: lz4 and XXH3 behind plain functions. Called by the page file's writer and
// reader. Thread rule: any. Cost: a hash runs at memory speed, lz4 decodes at about 2 GB/s a core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "io/page_file.h"
#include "io/result.h"

namespace shoal {

/// lz4 turns one byte into 255 at most: what claims to hold more is refused before memory is taken for it.
inline constexpr uint64_t kMaxLz4Ratio = 255;

/// The most bytes compress_page may write.
uint64_t compressed_bound_bytes(uint64_t raw_bytes);

/// Compresses into `out` (compressed_bound_bytes long). Returns the compressed size, or 0 when it does not pay: a
/// page that would not take fewer 4 KiB blocks is stored raw, which costs nothing to read.
uint32_t compress_page(std::span<const std::byte> raw, std::span<std::byte> out);

/// Decodes exactly out.size() bytes. False when `stored` is not such a page. Requires: the checksum was verified.
bool decompress_page(std::span<const std::byte> stored, std::span<std::byte> out);

/// XXH3-64 over (id, raw_bytes, stored_bytes, codec, kind, table), 16 bytes, followed by the stored payload.
uint64_t page_checksum(const PageRecord& record, std::span<const std::byte> payload);

/// XXH3-64 of plain bytes.
uint64_t hash_bytes(std::span<const std::byte> bytes);

/// The same hash of bytes that come piece by piece.
class PieceHash {
 public:
  PieceHash();
  ~PieceHash();
  void add(std::span<const std::byte> bytes);
  uint64_t value() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace shoal
