#include "treelets/partition_refs.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <vector>

namespace shoal {
namespace {

constexpr size_t kChunkRefs = 1u << 15;  // partitioned by one task; part of the result, so never by thread count
constexpr size_t kParallelRefs = 1u << 17;

struct Measure {
  LaneBox box, centroids;
};

// Without branches: which side a reference goes to cannot be foreseen. Every reference is swapped with the first of
// those that go right, and the border passes it when it goes left.
size_t partition_serial(std::span<BuildRef> refs, const Binning& binning, const SahSplit& split, LaneBox& left,
                        LaneBox& right) {
  const Binning::Side side = binning.side_of(split);
  const Lanes none = lanes_set(0.0f), all = lanes_not(none);
  // Or-ed with a centroid they make it no number, which is not included.
  const Lanes unless_left[2] = {all, none}, unless_right[2] = {none, all};
  LaneBox lefts = left, rights = right;
  size_t border = 0;
  for (size_t i = 0; i < refs.size(); ++i) {
    const BuildRef ref = refs[i];
    const Lanes centroid = binning_centroid(ref);
    const bool goes_left = side.left(centroid);
    const Lanes in_left = lanes_or(centroid, unless_left[goes_left]);
    const Lanes in_right = lanes_or(centroid, unless_right[goes_left]);
    lefts.lo = lanes_min(in_left, lefts.lo), lefts.hi = lanes_max(in_left, lefts.hi);
    rights.lo = lanes_min(in_right, rights.lo), rights.hi = lanes_max(in_right, rights.hi);
    refs[i] = refs[border];
    refs[border] = ref;
    border += goes_left;
  }
  left = lefts, right = rights;
  return border;
}

// A run of references on the wrong side of the final border.
struct Run {
  size_t begin, count;
};

// Swaps the references of `a` with those of `b`, pairwise in order. Requires: equal totals.
void swap_runs(std::span<BuildRef> refs, std::span<const Run> a, std::span<const Run> b) {
  struct Piece {
    size_t a, b, count;
  };
  std::vector<Piece> pieces;
  size_t i = 0, j = 0, i_done = 0, j_done = 0;
  while (i < a.size() && j < b.size()) {
    const size_t count = std::min(a[i].count - i_done, b[j].count - j_done);
    pieces.push_back({a[i].begin + i_done, b[j].begin + j_done, count});
    if ((i_done += count) == a[i].count) ++i, i_done = 0;
    if ((j_done += count) == b[j].count) ++j, j_done = 0;
  }
  tbb::parallel_for(size_t{0}, pieces.size(), [&](size_t k) {
    const auto from = refs.begin() + static_cast<ptrdiff_t>(pieces[k].a);
    std::swap_ranges(from, from + static_cast<ptrdiff_t>(pieces[k].count),
                     refs.begin() + static_cast<ptrdiff_t>(pieces[k].b));
  });
}

}  // namespace

size_t partition_refs(std::span<BuildRef> refs, const Binning& binning, const SahSplit& split, LaneBox& left,
                      LaneBox& right) {
  if (refs.size() < kParallelRefs) return partition_serial(refs, binning, split, left, right);
  struct Chunk {
    size_t left_count;
    LaneBox left, right;
  };
  std::vector<Chunk> chunks((refs.size() + kChunkRefs - 1) / kChunkRefs);
  tbb::parallel_for(size_t{0}, chunks.size(), [&](size_t i) {
    const size_t begin = i * kChunkRefs;
    Chunk& chunk = chunks[i];
    chunk.left_count = partition_serial(refs.subspan(begin, std::min(kChunkRefs, refs.size() - begin)), binning,
                                        split, chunk.left, chunk.right);
  });
  size_t border = 0;
  for (const Chunk& chunk : chunks) {
    border += chunk.left_count;
    left.include(chunk.left), right.include(chunk.right);
  }
  std::vector<Run> rights_before, lefts_after;
  for (size_t i = 0; i < chunks.size(); ++i) {
    const size_t begin = i * kChunkRefs, end = std::min(begin + kChunkRefs, refs.size());
    const size_t middle = begin + chunks[i].left_count;
    if (middle < std::min(end, border)) rights_before.push_back({middle, std::min(end, border) - middle});
    if (std::max(begin, border) < middle) {
      lefts_after.push_back({std::max(begin, border), middle - std::max(begin, border)});
    }
  }
  swap_runs(refs, rights_before, lefts_after);
  return border;
}

void measure_refs(std::span<const BuildRef> refs, LaneBox& box, LaneBox& centroids) {
  const auto add = [&](size_t begin, size_t end, Measure m) {
    for (size_t i = begin; i < end; ++i) {
      m.box.include(LaneBox{lanes_load3(refs[i].lo), lanes_load3(refs[i].hi)});
      m.centroids.include(binning_centroid(refs[i]));
    }
    return m;
  };
  const Measure m =
      refs.size() < kParallelRefs
          ? add(0, refs.size(), {})
          : tbb::parallel_reduce(
                tbb::blocked_range<size_t>(0, refs.size(), kChunkRefs), Measure{},
                [&](const tbb::blocked_range<size_t>& r, Measure m_in) { return add(r.begin(), r.end(), m_in); },
                [](Measure a, const Measure& b) {
                  a.box.include(b.box), a.centroids.include(b.centroids);
                  return a;
                });
  box = m.box, centroids = m.centroids;
}

void order_by_centroid(std::span<BuildRef> refs, size_t left_count, const LaneBox& centroids) {
  const Bounds3 b = centroids.bounds();
  int axis = 0;
  for (int a = 1; a < 3; ++a) {
    if (b.hi[a] - b.lo[a] > b.hi[axis] - b.lo[axis]) axis = a;
  }
  const auto key = [axis](const BuildRef& ref) { return 0.25f * ref.lo[axis] + 0.25f * ref.hi[axis]; };
  std::nth_element(refs.begin(), refs.begin() + static_cast<ptrdiff_t>(left_count), refs.end(),
                   [key](const BuildRef& x, const BuildRef& y) {
                     const float kx = key(x), ky = key(y);
                     return kx != ky ? kx < ky : x.id < y.id;
                   });
}

}  // namespace shoal
