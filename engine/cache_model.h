// A model of the processor's data caches: set-associative, the least recently touched line of a set leaves it, what
// is written is fetched first (write-allocate) and goes back when it leaves (write-back). It is told every address
// that a program touches and counts what each level is asked for and lacks, and the lines that move between memory
// and the outermost level, by kind of data. Called by engine/touch_recorder and bench/cache_traffic; knows nothing
// of rays.
//
// What it leaves out: hardware prefetchers, physical addresses (sets are chosen by the addresses it is told),
// coherence (what one thread writes stays in the caches of another), the program's code, what other programs take
// of the cache, stores that go past it.
//
// Levels stand one behind the other. A level is asked for what misses the one in front of it, and told the dirty
// lines that one lets go: those are whole, so nothing is fetched for them. No level includes or excludes what
// another has.
//
// Sampling: with one_in N only one in N sets is modelled, the counts of the others taken to be the same. All levels
// model the same lines, so what is modelled is exact; the sets are spread, so that arrays with a regular step are
// not caught at one place of the step.
//
// Threads: one a CacheModel; a SharedCache behind several takes turns. Cost: some 5 ns a line for the newest lines
// of a set, 20 for its oldest; 8 bytes a line of the caches, over one_in.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "io/result.h"

namespace shoal {

struct CacheShape {
  uint64_t bytes = 2u << 20;
  uint32_t ways = 16;
  uint32_t line_bytes = 64;

  uint64_t sets() const { return bytes / ways / line_bytes; }
  /// Fails with: kUsage (not a whole number of sets, or nothing at all; lines that are no power of two).
  Status check() const;
};

/// Which sets are modelled, of all levels alike: lines fall into 2^group_bits groups by their low bits.
struct SetSample {
  uint32_t one_in = 1, group_bits = 0;

  /// Requires: check().
  static SetSample of(std::span<const CacheShape> levels, uint32_t one_in);
  /// Fails with: kUsage (no power of two, or more than the sets of a level can be parted by; lines that differ).
  static Status check(std::span<const CacheShape> levels, uint32_t one_in);

  bool has(uint64_t line) const { return rank(line) < groups_kept(); }
  uint64_t groups_kept() const { return (uint64_t{1} << group_bits) / one_in; }
  /// Of the line's group, in an order that spreads neighbours. Odd, so that no two groups have the same.
  uint64_t rank(uint64_t line) const { return (line * 0x9e3779b97f4a7c15u) & ((uint64_t{1} << group_bits) - 1); }
};

/// One cache: which lines it has. A line is an address over the bytes of a line.
class CacheLevel {
 public:
  struct Evicted {
    uint64_t line = 0;
    uint8_t kind = 0;
    bool dirty = false;
  };

  /// Requires: shape.check() is well, and the shape was among those of the sample.
  CacheLevel(const CacheShape& shape, const SetSample& sample);

  /// Makes the line, which the sample has, the newest of its set, bringing it in where it is missing; returns
  /// whether it was there. A line has the kind of whoever brought it or wrote it last. `evicted` is set when a line
  /// was brought in; what left may be nothing (not dirty).
  bool touch(uint64_t line, bool write, uint8_t kind, Evicted& evicted);
  /// Lets all lines go; `let_go` is told the dirty ones.
  template <class LetGo>
  void flush(const LetGo& let_go) {
    for (uint64_t& place : places_) {
      if (place != kNothing && (place & kDirty) != 0) let_go(unpacked(place));
      place = kNothing;
    }
  }

 private:
  /// A place holds line << 8 | kind << 1 | dirty. A set's places stand from the newest to the oldest.
  static constexpr uint64_t kNothing = ~0ull, kDirty = 1;
  static uint64_t packed(uint64_t line, bool dirty, uint8_t kind) {
    return line << 8 | uint64_t{kind} << 1 | (dirty ? kDirty : 0);
  }
  static Evicted unpacked(uint64_t place) {
    return {place >> 8, static_cast<uint8_t>(place >> 1 & 0x7f), (place & kDirty) != 0};
  }
  uint64_t set_of(uint64_t line) const {
    const uint64_t high = line >> sample_.group_bits;
    const uint64_t row = mask_ != kNothing ? high & mask_ : high % rows_;
    return row * sample_.groups_kept() + sample_.rank(line);
  }

  SetSample sample_;
  uint32_t ways_;
  uint64_t rows_, mask_;  ///< sets of a group; less one where that is a power of two, else kNothing
  std::vector<uint64_t> places_;
};

/// Lines between memory and the outermost level.
struct LineCounts {
  uint64_t fills = 0, write_backs = 0;
  uint64_t total() const { return fills + write_backs; }
};

/// Of one level: lines asked for (of the innermost: lines of what is touched), those it lacked, dirty ones it let
/// go.
struct LevelCounts {
  uint64_t accesses = 0, misses = 0, write_backs = 0;
  void add(const LevelCounts& other) {
    accesses += other.accesses, misses += other.misses, write_backs += other.write_backs;
  }
};

class SharedCache;

class CacheModel {
 public:
  static constexpr uint32_t kMaxKinds = 16;
  struct Options {
    std::vector<CacheShape> levels{CacheShape{}};  ///< the innermost first
    uint32_t one_in = 1;                           ///< of the sets, so many are modelled

    /// Fails with: kUsage.
    Status check() const;
  };
  /// What reaches a level: asked for, or `whole`: let go by the one in front.
  struct LineTouch {
    uint64_t line;
    uint8_t kind;
    bool write, whole;
  };

  /// Requires: options.check() is well.
  explicit CacheModel(const Options& options)
      : CacheModel(options.levels, SetSample::of(options.levels, options.one_in), nullptr) {}
  /// The levels in front of `behind`, or of memory. Keeps a reference.
  CacheModel(std::span<const CacheShape> levels, const SetSample& sample, SharedCache* behind);

  /// The program reads, or writes, bytes from `address` on, data of `kind` (below kMaxKinds).
  void touch(uint64_t address, uint64_t bytes, bool write, uint8_t kind) {
    if (bytes == 0) return;
    const uint64_t last = (address + bytes - 1) >> line_bits_;
    for (uint64_t line = address >> line_bits_; line <= last; ++line) {
      if (line == newest_ && (!write || newest_dirty_)) {  // it is the newest, and stays so
        repeats_ += newest_kept_;
        continue;
      }
      newest_ = line, newest_dirty_ = write, newest_kept_ = sample_.has(line) ? 1 : 0;
      if (newest_kept_ != 0) reach(0, {line, kind, write, false});
    }
  }
  /// What comes from the levels in front, or from the program, a line at a time.
  void take(const LineTouch& touch) { reach(0, touch); }
  /// What waits for the cache behind goes there. To be called now and then, and at the end.
  void hand_on();
  /// Writes back what is still dirty, and empties the caches.
  void flush();

  /// Since it was made, times one_in.
  LineCounts counts(uint8_t kind) const;
  LineCounts counts() const;
  LevelCounts level(size_t index) const;
  size_t level_count() const { return levels_.size(); }
  uint32_t line_bytes() const { return uint32_t{1} << line_bits_; }

 private:
  void reach(size_t level, const LineTouch& touch);

  SetSample sample_;
  std::vector<CacheLevel> levels_;
  std::vector<LevelCounts> level_counts_;
  SharedCache* behind_;
  std::vector<LineTouch> waiting_;  ///< for the cache behind
  uint32_t line_bits_;
  uint64_t newest_ = ~0ull;
  uint64_t newest_kept_ = 0, repeats_ = 0;
  bool newest_dirty_ = false;
  std::array<LineCounts, kMaxKinds> counts_{};
};

/// The last level of several threads: what they hand on goes through one cache, piece by piece.
class SharedCache {
 public:
  SharedCache(const CacheShape& shape, const SetSample& sample) : model_({&shape, 1}, sample, nullptr) {}

  void take(std::span<const CacheModel::LineTouch> touches);
  /// Of one level. Requires for its functions: no thread hands anything on meanwhile.
  CacheModel& model() { return model_; }

 private:
  std::mutex mutex_;
  CacheModel model_;
};

}  // namespace shoal
