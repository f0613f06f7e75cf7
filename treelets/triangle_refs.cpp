#include "treelets/triangle_refs.h"

#include <tbb/parallel_for.h>

namespace shoal {
namespace {

constexpr size_t kChunkTriangles = 1u << 14;

}  // namespace

std::vector<BuildRef> make_refs(std::span<const float> positions) {
  const size_t count = positions.size() / 9, chunk_count = (count + kChunkTriangles - 1) / kChunkTriangles;
  std::vector<size_t> begin(chunk_count + 1, 0);
  const auto for_each_stored = [&](size_t chunk, auto visit) {
    const size_t end = std::min(count, (chunk + 1) * kChunkTriangles);
    for (size_t i = chunk * kChunkTriangles; i < end; ++i) {
      if (!is_degenerate(&positions[9 * i])) visit(i);
    }
  };
  tbb::parallel_for(size_t{0}, chunk_count,
                    [&](size_t chunk) { for_each_stored(chunk, [&](size_t) { ++begin[chunk + 1]; }); });
  for (size_t chunk = 0; chunk < chunk_count; ++chunk) begin[chunk + 1] += begin[chunk];
  std::vector<BuildRef> refs(begin[chunk_count]);
  tbb::parallel_for(size_t{0}, chunk_count, [&](size_t chunk) {
    size_t next = begin[chunk];
    for_each_stored(chunk, [&](size_t i) {
      refs[next++] = make_triangle_ref(&positions[9 * i], static_cast<uint32_t>(i));
    });
  });
  return refs;
}

}  // namespace shoal
