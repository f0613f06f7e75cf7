// All decoded pages of a PageFile laid out in one plain file, mapped read-only, so that the operating system decides
// which of them are in memory. The rival that the page cache is measured against (bench/out_of_core); called by bench
// and, through serve_from(), by PageCache.
//
// Layout: the pages in order of their ids but for tables, each at a multiple of 4 KiB, decoded, with at least 64 zero
// bytes after its end. Nothing says which scene the file belongs to: its size is all that is checked.
// Thread rule: immutable, any number of threads. Cost: none a look-up; a page that is not in memory is a fault a 4 KiB
// block, or a read-ahead's worth of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/page_cache.h"
#include "io/page_file.h"
#include "io/result.h"

namespace shoal {

enum class MapAdvice : uint8_t {
  kNormal,  ///< the kernel reads ahead as it sees fit
  kRandom,  ///< it reads the block that is touched
};

class MappedPages {
 public:
  /// Decodes and checks every page once and writes them to `path`, which appears whole or not at all.
  /// Fails with: kCorrupt, kStorage.
  static Status write(FileSystem& fs, const PageFile& file, const PageCheck& check, const std::string& path);
  /// Maps what write() wrote for the same page file, after asking the system to forget what it holds of it.
  /// Fails with: kInput (missing, another size), kStorage.
  static Result<std::unique_ptr<MappedPages>> open(const PageFile& file, const std::string& path, MapAdvice advice);
  /// Size of the file that write() makes.
  static uint64_t file_bytes(const PageFile& file);
  ~MappedPages();

  /// 64 readable zero bytes follow the end, as after PagePin::bytes(). Requires: not a table's page.
  std::span<const std::byte> bytes(PageId page) const;

 private:
  MappedPages(const PageFile& file, const std::byte* data, uint64_t size_bytes);
  const PageFile& file_;
  const std::byte* data_;
  uint64_t size_bytes_;
  std::vector<uint64_t> offsets_;  ///< by page
};

}  // namespace shoal
