// A model of the processor's data caches: set-associative, the least recently touched line of a set leaves it, what is
// written is fetched first (write-allocate) and goes back to memory when it leaves (write-back). It is told every
// address that a program touches and counts the lines that move between memory and the outer cache, by kind of data.
// Called by bench/cache_traffic; knows nothing of rays.
//
// What it leaves out: hardware prefetchers, physical addresses (sets are chosen by the addresses it is told), what
// other programs and the program's code take of the cache, stores that go past it.
//
// An inner cache in front is optional. Then the outer one sees only what misses the inner one, and dirty lines that
// the inner one lets go: those are whole, so nothing is fetched for them. Neither includes nor excludes what the other
// has.
//
// Sampling: with `sample` N only one in N sets is modelled, the counts of the others taken to be the same. The sets
// are spread, so that arrays with a regular step are not caught at one place of the step.
//
// Threads: one. Cost: some 5 ns a line for the newest lines of a set, 20 for its oldest; 8 bytes a line of the cache.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "io/result.h"

namespace shoal::bench {

struct CacheShape {
  uint64_t bytes = 2u << 20;
  uint32_t ways = 16;
  uint32_t line_bytes = 64;

  uint64_t sets() const { return bytes / ways / line_bytes; }
  /// Fails with: kUsage (no power of two of sets or of bytes a line, or nothing at all).
  Status check() const;
};

/// One cache: which lines it has. A line is an address over the bytes of a line.
class CacheLevel {
 public:
  struct Evicted {
    uint64_t line = 0;
    uint8_t kind = 0;
    bool dirty = false;
  };

  /// Requires: shape.check() is well.
  explicit CacheLevel(const CacheShape& shape);

  /// Makes the line the newest of its set, bringing it in where it is missing; returns whether it was there. A line
  /// has the kind of whoever brought it or wrote it last. `evicted` is set when a line was brought in; what left may
  /// be nothing (not dirty).
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

  uint32_t ways_;
  uint64_t set_mask_;
  std::vector<uint64_t> places_;
};

/// Lines between memory and the outer cache.
struct LineCounts {
  uint64_t fills = 0, write_backs = 0;
  uint64_t total() const { return fills + write_backs; }
};

class CacheModel {
 public:
  static constexpr uint32_t kMaxKinds = 16;
  struct Options {
    CacheShape outer;
    std::optional<CacheShape> inner;
    uint32_t sample = 1;  ///< one in so many sets, a power of two, at most the sets of either cache

    /// Fails with: kUsage.
    Status check() const;
  };

  /// Requires: options.check() is well.
  explicit CacheModel(const Options& options);

  /// The program reads, or writes, bytes from `address` on, data of `kind` (below kMaxKinds).
  void touch(uint64_t address, uint64_t bytes, bool write, uint8_t kind) {
    const uint64_t last = (address + bytes - 1) >> line_bits_;
    for (uint64_t line = address >> line_bits_; line <= last; ++line) {
      if (line == newest_ && (!write || newest_dirty_)) continue;  // it is the newest, and stays so
      newest_ = line, newest_dirty_ = write;
      if (sampled(line)) touch_line(line, write, kind);
    }
  }
  /// Writes back what is still dirty, and empties the caches.
  void flush();

  /// Since it was made, times the sample.
  LineCounts counts(uint8_t kind) const;
  LineCounts counts() const;
  uint32_t line_bytes() const { return uint32_t{1} << line_bits_; }

 private:
  bool sampled(uint64_t line) const { return ((line * kSpread) & group_mask_) < sampled_groups_; }
  void touch_line(uint64_t line, bool write, uint8_t kind);
  void reach_outer(uint64_t line, bool write, uint8_t kind, bool whole);

  static constexpr uint64_t kSpread = 0x9e3779b97f4a7c15u;  ///< odd: lines of a group stay apart from other groups
  CacheLevel outer_;
  std::optional<CacheLevel> inner_;
  uint32_t line_bits_, sample_;
  uint64_t group_mask_, sampled_groups_;
  uint64_t newest_ = ~0ull;
  bool newest_dirty_ = false;
  std::array<LineCounts, kMaxKinds> counts_{};
};

}  // namespace shoal::bench
