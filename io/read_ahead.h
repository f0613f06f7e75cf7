// Reads files in sequence faster than they are asked for: several streams at once, each remembered in a window that
// grows as the stream goes on, so that direct reads (O_DIRECT, which nothing else reads ahead) are large where bytes
// are wanted in order and no larger than what is asked where they are not. Called by gltf::BufferFiles. Thread rule:
// one thread. Cost: a copy of every byte; at most kReadAheadBytes of memory.
#pragma once

#include <array>
#include <span>

#include "io/aligned_buffer.h"
#include "io/file.h"

namespace shoal {

class ReadAhead {
 public:
  static constexpr uint64_t kWindowBytes = 512u << 10;
  static constexpr size_t kWindowCount = 8;  ///< streams: indices, positions, normals, tangents, colours, three of UVs

  /// Fills `out` from byte `offset` of `file`, which is known as number `key` from call to call. Fails as
  /// ReadableFile::read_at does, and with kMemoryCap.
  Status read(ReadableFile& file, uint32_t key, uint64_t offset, std::span<std::byte> out);

 private:
  struct Window {
    uint32_t key = 0;
    uint64_t begin = 0, end = 0;  // of the file, what `bytes` holds; empty: unused
    uint64_t next_bytes = 0;      // of the read that continues this one
    uint64_t last_used = 0;
    AlignedBuffer memory;
    std::span<const std::byte> bytes;
  };
  Window* find(uint32_t key, uint64_t offset);
  Status fill(Window& window, ReadableFile& file, uint64_t offset, uint64_t wanted_bytes);

  std::array<Window, kWindowCount> windows_;
  uint64_t clock_ = 0;
};

inline constexpr uint64_t kReadAheadBytes = ReadAhead::kWindowCount * (ReadAhead::kWindowBytes + 2 * kBlockBytes);

}  // namespace shoal
