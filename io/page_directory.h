// Reads and checks what says where the pages are: superblock, footer, directory. Called by PageFile::open() and
// PageFile::verify(). After it, every record is in range, in order, without gap or overlap, and its sizes are
// bounded; the payloads are not read. Thread rule: any. Cost: three reads; the directory in pieces.
#pragma once

#include <vector>

#include "io/file.h"
#include "io/page_file.h"

namespace shoal {

/// Where a table lies: consecutive pages.
struct TableRange {
  TableId table = 0;
  PageId first_page = 0;
  uint32_t page_count = 0;
  uint64_t bytes = 0;
};

struct PageDirectory {
  std::vector<PageRecord> records;
  std::vector<TableRange> tables;  ///< in order of their pages
};

/// Fails with: kStorage, kInput (no .shoal file, or another version), kCorrupt (file, offset, expected, found).
Result<PageDirectory> read_page_directory(ReadableFile& file);

}  // namespace shoal
