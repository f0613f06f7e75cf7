#include "treelets/triangle_refs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

namespace shoal {
namespace {

constexpr size_t kChunkTriangles = 1u << 14;

}  // namespace

RefArray make_refs(std::span<const float> positions) {
  const size_t count = positions.size() / 9, chunk_count = (count + kChunkTriangles - 1) / kChunkTriangles;
  RefArray array(count);
  const std::span<BuildRef> refs = array.refs();
  std::vector<size_t> stored(chunk_count);
  tbb::parallel_for(size_t{0}, chunk_count, [&](size_t chunk) {
    const size_t first = chunk * kChunkTriangles, end = std::min(count, first + kChunkTriangles);
    size_t next = first;
    for (size_t i = first; i < end; ++i) {
      const CornerLanes corners(&positions[9 * i]);
      if (!is_degenerate(corners)) refs[next++] = make_triangle_ref(corners, static_cast<uint32_t>(i));
    }
    stored[chunk] = next - first;
  });
  size_t sum = 0;
  for (size_t chunk = 0; chunk < chunk_count; ++chunk) {  // closes the gaps that degenerate triangles left
    const auto from = refs.begin() + static_cast<ptrdiff_t>(chunk * kChunkTriangles);
    const auto to = refs.begin() + static_cast<ptrdiff_t>(sum);
    if (from != to) std::copy(from, from + static_cast<ptrdiff_t>(stored[chunk]), to);
    sum += stored[chunk];
  }
  array.truncate(sum);
  return array;
}

}  // namespace shoal
