#include "bench/cache_model.h"

#include <algorithm>
#include <bit>

#include <fmt/format.h>

namespace shoal::bench {

Status CacheShape::check() const {
  const bool whole = ways > 0 && line_bytes > 0 && bytes % (uint64_t{ways} * line_bytes) == 0;
  if (whole && std::has_single_bit(line_bytes) && line_bytes >= 8 && std::has_single_bit(sets())) return {};
  return Error{ErrorCode::kUsage,
               fmt::format("a cache of {} bytes, {} ways and lines of {} bytes: both the number of sets and the bytes "
                           "of a line must be a power of two",
                           bytes, ways, line_bytes)};
}

CacheLevel::CacheLevel(const CacheShape& shape)
    : ways_(shape.ways), set_mask_(shape.sets() - 1), places_(shape.sets() * shape.ways, kNothing) {}

bool CacheLevel::touch(uint64_t line, bool write, uint8_t kind, Evicted& evicted) {
  uint64_t* const set = places_.data() + (line & set_mask_) * ways_;
  const auto move_to_front = [&](uint32_t from, uint64_t place) {
    for (uint32_t i = from; i > 0; --i) set[i] = set[i - 1];
    set[0] = place;
  };
  for (uint32_t way = 0; way < ways_; ++way) {
    const uint64_t place = set[way];
    if (place >> 8 != line) continue;
    move_to_front(way, write ? packed(line, true, kind) : place);
    return true;
  }
  const uint64_t oldest = set[ways_ - 1];
  evicted = oldest == kNothing ? Evicted{} : unpacked(oldest);
  move_to_front(ways_ - 1, packed(line, write, kind));
  return false;
}

Status CacheModel::Options::check() const {
  SHOAL_RETURN_IF_ERROR(outer.check());
  uint64_t sets = outer.sets();
  if (inner.has_value()) {
    SHOAL_RETURN_IF_ERROR(inner->check());
    if (inner->line_bytes != outer.line_bytes) return Error{ErrorCode::kUsage, "both caches must have the same lines"};
    sets = std::min(sets, inner->sets());
  }
  if (std::has_single_bit(sample) && sample <= sets) return {};
  return Error{ErrorCode::kUsage, fmt::format("one in {} sets: a power of two of at most {} is wanted", sample, sets)};
}

CacheModel::CacheModel(const Options& options)
    : outer_(options.outer),
      line_bits_(static_cast<uint32_t>(std::countr_zero(options.outer.line_bytes))),
      sample_(options.sample) {
  uint64_t groups = options.outer.sets();
  if (options.inner.has_value()) {
    inner_.emplace(*options.inner);
    groups = std::min(groups, options.inner->sets());
  }
  group_mask_ = groups - 1;
  sampled_groups_ = groups / options.sample;
}

void CacheModel::touch_line(uint64_t line, bool write, uint8_t kind) {
  if (!inner_.has_value()) return reach_outer(line, write, kind, false);
  CacheLevel::Evicted evicted;
  if (inner_->touch(line, write, kind, evicted)) return;
  reach_outer(line, false, kind, false);
  if (evicted.dirty) reach_outer(evicted.line, true, evicted.kind, true);
}

void CacheModel::reach_outer(uint64_t line, bool write, uint8_t kind, bool whole) {
  CacheLevel::Evicted evicted;
  if (outer_.touch(line, write, kind, evicted)) return;
  if (!whole) ++counts_[kind].fills;
  if (evicted.dirty) ++counts_[evicted.kind].write_backs;
}

void CacheModel::flush() {
  if (inner_.has_value()) {
    inner_->flush([&](const CacheLevel::Evicted& line) { reach_outer(line.line, true, line.kind, true); });
  }
  outer_.flush([&](const CacheLevel::Evicted& line) { ++counts_[line.kind].write_backs; });
  newest_ = ~0ull;
}

LineCounts CacheModel::counts(uint8_t kind) const {
  return {counts_[kind].fills * sample_, counts_[kind].write_backs * sample_};
}

LineCounts CacheModel::counts() const {
  LineCounts sum;
  for (uint8_t kind = 0; kind < kMaxKinds; ++kind) {
    sum.fills += counts(kind).fills, sum.write_backs += counts(kind).write_backs;
  }
  return sum;
}

}  // namespace shoal::bench
