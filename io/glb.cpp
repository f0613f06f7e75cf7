#include "io/glb.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>

namespace shoal::gltf {

static_assert(std::endian::native == std::endian::little, "the numbers of a .glb are little-endian");

namespace {

constexpr uint32_t kMagic = 0x46546c67;        // "glTF"
constexpr uint32_t kJsonChunk = 0x4e4f534a;    // "JSON"
constexpr uint32_t kBinaryChunk = 0x004e4942;  // "BIN\0"
constexpr uint64_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

template <size_t N>
Result<std::array<uint32_t, N>> read_words(ReadableFile& file, uint64_t offset) {
  std::array<uint32_t, N> words;
  SHOAL_RETURN_IF_ERROR(file.read_at(offset, std::as_writable_bytes(std::span(words))));
  return words;
}

Error bad(const ReadableFile& file, uint64_t offset, const std::string& message) {
  return Error{ErrorCode::kInput, fmt::format("{}: byte {}: {}", file.path(), offset, message)};
}

}  // namespace

Result<std::optional<GlbChunks>> find_glb_chunks(ReadableFile& file) {
  if (file.size_bytes() < sizeof kMagic) return std::optional<GlbChunks>();
  SHOAL_ASSIGN_OR_RETURN(const auto magic, read_words<1>(file, 0));
  if (magic[0] != kMagic) return std::optional<GlbChunks>();
  if (file.size_bytes() < kHeaderBytes) return bad(file, 0, "expected a .glb header of 12 bytes, found the end");
  SHOAL_ASSIGN_OR_RETURN(const auto header, read_words<3>(file, 0));
  if (header[1] != 2) return bad(file, 4, fmt::format("expected glTF version 2, found {}", header[1]));
  const uint64_t end = header[2];
  if (end > file.size_bytes()) {
    return bad(file, 8,
               fmt::format("expected a length within the {} bytes of the file, found {}", file.size_bytes(), end));
  }
  GlbChunks chunks;
  for (uint64_t offset = kHeaderBytes; offset + kChunkHeaderBytes <= end;) {
    SHOAL_ASSIGN_OR_RETURN(const auto chunk, read_words<2>(file, offset));
    const FileRange range{offset + kChunkHeaderBytes, chunk[0]};
    if (range.bytes > end - range.offset) {
      return bad(file, offset,
                 fmt::format("expected a chunk of at most {} bytes, found {}", end - range.offset, range.bytes));
    }
    const bool first = offset == kHeaderBytes;
    if (first != (chunk[1] == kJsonChunk)) return bad(file, offset, "expected one JSON chunk, and that first");
    if (first) chunks.json = range;
    if (chunk[1] == kBinaryChunk && !chunks.binary) {
      chunks.binary = range;
      break;  // what follows belongs to extensions
    }
    offset = range.offset + (range.bytes + 3) / 4 * 4;
  }
  if (chunks.json.bytes == 0) return bad(file, kHeaderBytes, "expected a JSON chunk, found none");
  return std::optional(chunks);
}

}  // namespace shoal::gltf
