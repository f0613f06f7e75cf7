// The `.shoal` container: numbered pages of bytes, each lz4 or raw, each with an XXH3 checksum, found
// through a directory; the footer is written last. It knows nothing of geometry. docs/file_format.md is
// the byte-level document. Written by engine/build_scene, read by io/page_cache and engine/open_scene.
// Thread rule: a writer belongs to one thread; a PageFile is immutable after open() and may be read from
// many threads. Cost: a read is one pread, one hash and one decompression.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

using PageId = uint32_t;
inline constexpr PageId kNoPage = 0xffffffffu;
inline constexpr uint32_t kPageAlignment = 4096;             ///< every page starts at a multiple of it
inline constexpr uint32_t kMaxPageBytes = 64u << 20;         ///< of a decoded page; larger input is refused
inline constexpr uint32_t kTablePageBytes = 4u << 20;        ///< a table is cut into pages of this size

enum class PageKind : uint8_t {
  kTable = 1,       ///< part of a table of the scene (TableId says which)
  kTreelet = 2,     ///< treelet geometry (treelets/treelet_layout.h)
  kAttributes = 3,  ///< shading attributes of a treelet (treelets/attribute_layout.h)
  kTexture = 4,     ///< a texture tile (engine/scene_tables.h)
};
enum class PageCodec : uint8_t { kRaw = 0, kLz4 = 1 };

/// Tables are named by a small number; each is stored once. The meaning belongs to the floors above.
using TableId = uint16_t;

struct PageRecord {       // 40 bytes, as stored in the directory
  uint64_t offset;        ///< byte offset in the file, multiple of kPageAlignment
  uint64_t checksum;      ///< XXH3-64 over (id, raw_bytes, stored_bytes, codec, kind, table, payload)
  uint32_t raw_bytes;     ///< decoded size
  uint32_t stored_bytes;  ///< size in the file, without padding
  uint32_t id;
  uint16_t table;         ///< TableId for kTable pages, else 0
  PageKind kind;
  PageCodec codec;
  uint64_t reserved;      ///< zero
};
static_assert(sizeof(PageRecord) == 40);

/// Where the stored bytes of a page lie: whole blocks.
struct StoredRange {
  uint64_t offset = 0;
  uint64_t bytes = 0;
};

class PageFileWriter {
 public:
  /// Bytes go to a temporary file beside `path` until finish(). Fails with: kStorage.
  static Result<PageFileWriter> create(FileSystem& fs, const std::string& path);
  PageFileWriter(PageFileWriter&&) noexcept;
  PageFileWriter& operator=(PageFileWriter&&) noexcept;
  ~PageFileWriter();

  /// Appends one page and returns its id (0, 1, 2, ... in order of appending). Compresses with lz4, and keeps that
  /// where it takes fewer 4 KiB blocks. A writer that failed stays failed.
  /// Requires: kind is not kTable, 0 < bytes.size() <= kMaxPageBytes. Fails with: kStorage.
  Result<PageId> append(PageKind kind, std::span<const std::byte> bytes);
  /// Stores a table as consecutive pages; an empty one as a single page of no bytes, so that it is not absent.
  /// Requires: each TableId at most once.
  Status append_table(TableId table, std::span<const std::byte> bytes);
  uint64_t bytes_written() const;
  uint32_t page_count() const;
  /// Directory, footer, fsync, rename, fsync of the directory.
  Status finish();

 private:
  struct State;
  explicit PageFileWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

struct TableRange;

class PageFile {
 public:
  /// Reads superblock, footer and directory, and checks them (checksums, ranges, order, no overlap).
  /// Fails with: kInput (missing, not a .shoal file, another version), kCorrupt (file, offset, expected, found).
  static Result<std::unique_ptr<PageFile>> open(FileSystem& fs, const std::string& path, ReadMode mode);
  ~PageFile();

  const std::string& path() const { return path_; }
  uint64_t file_bytes() const { return file_bytes_; }
  /// As it was asked for.
  ReadMode read_mode() const { return read_mode_; }
  std::span<const PageRecord> records() const { return records_; }
  uint32_t page_count() const { return static_cast<uint32_t>(records_.size()); }
  /// Requires: id < page_count().
  const PageRecord& record(PageId id) const { return records_[id]; }

  /// Reads, verifies and decodes one page into `out` (exactly record(id).raw_bytes long). Sets
  /// `*read_bytes` to the bytes asked of the disk (whole 4 KiB blocks). Fails with: kStorage, kCorrupt.
  Status read_page(PageId id, std::span<std::byte> out, uint64_t* read_bytes) const;
  /// The two halves of read_page(), for reads that go on by themselves: the bytes to read, and what makes a page of
  /// them (`stored` is as long as the range). Fails with: kCorrupt.
  StoredRange stored_range(PageId id) const;
  Status decode_page(PageId id, std::span<const std::byte> stored, std::span<std::byte> out) const;
  ReadableFile& file() const { return *file_; }
  /// The whole of a table; empty when it was stored empty. Fails with: kCorrupt when it is absent or larger
  /// than `limit_bytes`.
  Result<std::vector<std::byte>> read_table(TableId table, uint64_t limit_bytes) const;
  /// The same straight into its place, so that it is in memory once: its size first, then exactly so many bytes.
  Result<uint64_t> table_bytes(TableId table, uint64_t limit_bytes) const;
  Status read_table_into(TableId table, std::span<std::byte> out) const;
  bool has_table(TableId table) const;
  /// Reads every byte of the file: checksums, padding that must be zero, gaps. Stops at the first damage.
  /// Fails with: kStorage, kCorrupt.
  Status verify() const;

 private:
  PageFile();
  const TableRange* find_table(TableId table) const;
  std::string path_;
  uint64_t file_bytes_ = 0;
  ReadMode read_mode_ = ReadMode::kBuffered;
  std::vector<PageRecord> records_;
  std::vector<TableRange> tables_;
  std::unique_ptr<ReadableFile> file_;
};

}  // namespace shoal
