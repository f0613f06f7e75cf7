#include "engine/cache_model.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {
namespace {

/// Touches that wait for the shared cache before it is locked for them.
constexpr size_t kHandedOnAtOnce = 512;

/// Low bits of a line that say, at every level, which sets it cannot be in.
uint32_t common_bits(std::span<const CacheShape> levels) {
  int bits = 63;
  for (const CacheShape& level : levels) bits = std::min(bits, std::countr_zero(level.sets()));
  return static_cast<uint32_t>(bits);
}

}  // namespace

Status CacheShape::check() const {
  const bool whole = ways > 0 && line_bytes > 0 && bytes > 0 && bytes % (uint64_t{ways} * line_bytes) == 0;
  if (whole && std::has_single_bit(line_bytes) && line_bytes >= 8) return {};
  return Error{
      ErrorCode::kUsage,
      fmt::format("a cache of {} bytes, {} ways and lines of {} bytes: it must be a whole number of sets, the "
                  "bytes of a line a power of two",
                  bytes, ways, line_bytes)};
}

Status SetSample::check(std::span<const CacheShape> levels, uint32_t one_in) {
  if (levels.empty()) return Error{ErrorCode::kUsage, "a model of no cache"};
  for (const CacheShape& level : levels) {
    SHOAL_RETURN_IF_ERROR(level.check());
    if (level.line_bytes != levels[0].line_bytes) {
      return Error{ErrorCode::kUsage, "all caches must have the same lines"};
    }
  }
  const uint64_t most = uint64_t{1} << common_bits(levels);
  if (std::has_single_bit(one_in) && one_in <= most) return {};
  return Error{ErrorCode::kUsage,
               fmt::format("one in {} sets: a power of two of at most {} is wanted", one_in, most)};
}

SetSample SetSample::of(std::span<const CacheShape> levels, uint32_t one_in) {
  return {one_in, one_in == 1 ? 0 : common_bits(levels)};
}

CacheLevel::CacheLevel(const CacheShape& shape, const SetSample& sample)
    : sample_(sample),
      ways_(shape.ways),
      rows_(shape.sets() >> sample.group_bits),
      mask_(std::has_single_bit(rows_) ? rows_ - 1 : kNothing),
      places_(rows_ * sample.groups_kept() * shape.ways, kNothing) {}

bool CacheLevel::touch(uint64_t line, bool write, uint8_t kind, Evicted& evicted) {
  uint64_t* const set = places_.data() + set_of(line) * ways_;
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

Status CacheModel::Options::check() const { return SetSample::check(levels, one_in); }

CacheModel::CacheModel(std::span<const CacheShape> levels, const SetSample& sample, SharedCache* behind)
    : sample_(sample),
      level_counts_(levels.size()),
      behind_(behind),
      line_bits_(static_cast<uint32_t>(std::countr_zero(levels[0].line_bytes))) {
  for (const CacheShape& level : levels) levels_.emplace_back(level, sample);
}

void CacheModel::reach(size_t level, const LineTouch& touch) {
  if (level == levels_.size()) {
    if (behind_ == nullptr) {
      ++(touch.whole ? counts_[touch.kind].write_backs : counts_[touch.kind].fills);
    } else {
      waiting_.push_back(touch);
      if (waiting_.size() == kHandedOnAtOnce) hand_on();
    }
    return;
  }
  LevelCounts& counts = level_counts_[level];
  if (!touch.whole) ++counts.accesses;
  CacheLevel::Evicted evicted;
  if (levels_[level].touch(touch.line, touch.write, touch.kind, evicted)) return;
  if (!touch.whole) {
    ++counts.misses;
    reach(level + 1, {touch.line, touch.kind, false, false});
  }
  if (!evicted.dirty) return;
  ++counts.write_backs;
  reach(level + 1, {evicted.line, evicted.kind, true, true});
}

void CacheModel::hand_on() {
  if (behind_ != nullptr) behind_->take(waiting_);
  waiting_.clear();
}

void CacheModel::flush() {
  for (size_t level = 0; level < levels_.size(); ++level) {
    levels_[level].flush([&](const CacheLevel::Evicted& line) {
      ++level_counts_[level].write_backs;
      reach(level + 1, {line.line, line.kind, true, true});
    });
  }
  hand_on();
  newest_ = ~0ull;
}

LineCounts CacheModel::counts(uint8_t kind) const {
  return {counts_[kind].fills * sample_.one_in, counts_[kind].write_backs * sample_.one_in};
}

LineCounts CacheModel::counts() const {
  LineCounts sum;
  for (uint8_t kind = 0; kind < kMaxKinds; ++kind) {
    sum.fills += counts(kind).fills, sum.write_backs += counts(kind).write_backs;
  }
  return sum;
}

LevelCounts CacheModel::level(size_t index) const {
  const LevelCounts& counts = level_counts_[index];
  const uint64_t n = sample_.one_in, repeats = index == 0 ? repeats_ : 0;
  return {(counts.accesses + repeats) * n, counts.misses * n, counts.write_backs * n};
}

void SharedCache::take(std::span<const CacheModel::LineTouch> touches) {
  std::lock_guard guard(mutex_);
  for (const CacheModel::LineTouch& touch : touches) model_.take(touch);
}

}  // namespace shoal
