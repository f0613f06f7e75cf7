// Small paged files for tests of what lies above them: pages whose bytes can be told from their number.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/page_file.h"

namespace shoal {

/// Bytes that lz4 packs well (period > 0) or not at all (period = 0).
std::vector<std::byte> pattern_bytes(size_t size, uint32_t seed, uint32_t period);

struct PageSpec {
  PageKind kind = PageKind::kTreelet;
  uint32_t bytes = 4096;
};
/// What page `id` of write_pages() holds: odd ones do not compress.
std::vector<std::byte> page_bytes(PageId id, uint32_t bytes);
/// Writes and opens a file of such pages; the test fails when that fails.
std::unique_ptr<PageFile> write_pages(FileSystem& fs, const std::string& path, const std::vector<PageSpec>& pages);

}  // namespace shoal
