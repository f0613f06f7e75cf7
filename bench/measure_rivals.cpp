#include "bench/measure_rivals.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace shoal::bench {
namespace {

constexpr uint64_t kStreamRays[] = {256, 1024, 4096};

/// A program's turns.
struct Turns {
  std::function<TeamSeconds()> run;
  std::vector<double> seconds;

  double median() {
    std::sort(seconds.begin(), seconds.end());
    return seconds[seconds.size() / 2];
  }
};

/// `rounding` of positions, in units of distance.
bool same_hit(const RayAnswer& a, const RayAnswer& b, float rounding) {
  if ((a.primitive == kNoIndex) != (b.primitive == kNoIndex)) return false;
  return a.primitive == kNoIndex || std::abs(a.t - b.t) <= kSameHit * std::max(a.t, b.t) + rounding;
}

bool same_bits(const RayAnswer& a, const RayAnswer& b) {
  return std::bit_cast<uint32_t>(a.t) == std::bit_cast<uint32_t>(b.t) &&
         (a.primitive == kNoIndex) == (b.primitive == kNoIndex);
}

/// Measures one set of rays with one number of threads.
class RivalRun {
 public:
  RivalRun(const MemoryScene& scene, const RaySet& set, const MeasureOptions& options)
      : scene_(scene),
        set_(set),
        options_(options),
        sorter_(scene.top_tree().bounds(), options.order.threads, set.rays.size()),
        ours_(set.rays.size()),
        answers_(set.rays.size()) {
    row_.workload = set.name;
    row_.threads = options.order.threads;
    row_.rays = set.rays.size();
    turns_.reserve(16);  // references to its elements are kept
  }

  RivalRow run(const EmbreeScene& usual, const EmbreeScene& compact) {
    std::vector<Turns*> shoal, streams;
    for (size_t i = 0; i < kOrderCount; ++i) shoal.push_back(&add_order(i));
    Turns& with_default = add_embree(usual, {});
    Turns& with_compact = add_embree(compact, {});
    const EmbreeScene& faster = with_compact.seconds[0] < with_default.seconds[0] ? compact : usual;
    Turns& packet = add_embree(faster, {.call = EmbreeCall::kPacket});
    Turns& sorted = add_embree(faster, {.sorter = &sorter_});
    for (const uint64_t rays : kStreamRays) {
      streams.push_back(&add_embree(faster, {.call = EmbreeCall::kStream, .stream_rays = rays}));
    }
    std::vector<double> bounds;
    for (Turns& turns : turns_) turns.seconds.clear();  // they were warming up
    all_ = {};
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (Turns& turns : turns_) turns.seconds.push_back(seconds_of(turns.run()));
      bounds.push_back(bound_rays_per_second(scene_, set_, row_.threads, options_.cpu_time));
    }
    row_.cpu_share = all_.cpu / all_.wall;
    std::sort(bounds.begin(), bounds.end());
    row_.bound = bounds[bounds.size() / 2] * 1e-6;
    for (size_t i = 0; i < kOrderCount; ++i) row_.shoal[i] = rate(*shoal[i]);
    row_.embree_default = rate(with_default), row_.embree_compact = rate(with_compact);
    row_.embree_packet = rate(packet), row_.embree_sorted = rate(sorted);
    for (size_t i = 0; i < streams.size(); ++i) {
      if (const double here = rate(*streams[i]); here > row_.embree_stream) {
        row_.embree_stream = here, row_.stream_rays = kStreamRays[i];
      }
    }
    return row_;
  }

 private:
  double seconds_of(const TeamSeconds& seconds) {
    all_.wall += seconds.wall, all_.cpu += seconds.cpu;
    return options_.cpu_time ? seconds.cpu : seconds.wall;
  }
  double rate(Turns& turns) const { return static_cast<double>(row_.rays) / turns.median() * 1e-6; }

  /// Adds a program, and warms it up.
  Turns& add(std::function<TeamSeconds()> run) {
    std::fill(answers_.begin(), answers_.end(), RayAnswer{-1, 0});  // no program's answer
    Turns& turns = turns_.emplace_back(std::move(run), std::vector<double>());
    turns.seconds.push_back(seconds_of(turns.run()));
    return turns;
  }

  Turns& add_order(size_t i) {
    orders_[i] = make_order(kOrders[i], scene_, options_.order, row_.rays);
    Turns& turns = add([this, i] {
      const OrderRun run = orders_[i]->run(set_, answers_);
      row_.counts[i] = run.counts;
      return run.seconds;
    });
    if (i == 0) {
      ours_ = answers_;
      row_.hits = static_cast<uint64_t>(
          std::count_if(ours_.begin(), ours_.end(), [](const RayAnswer& a) { return a.primitive != kNoIndex; }));
    }
    row_.orders_disagreeing = std::max(row_.orders_disagreeing, count_different(same_bits));
    return turns;
  }

  Turns& add_embree(const EmbreeScene& scene, const EmbreeRun& run) {
    Turns& turns =
        add([this, &scene, run] { return trace_with_embree(scene, set_, row_.threads, run, answers_); });
    const Bounds3 bounds = scene_.top_tree().bounds();
    const Vec3 largest = glm::max(glm::abs(bounds.lo), glm::abs(bounds.hi));
    const float rounding = kSameHitRoundings * kRoundingUnit * std::max({largest.x, largest.y, largest.z});
    const auto same = [&](const RayAnswer& a, const RayAnswer& b) { return same_hit(a, b, rounding); };
    row_.disagreeing = std::max(row_.disagreeing, count_different(same));
    return turns;
  }

  template <class Same>
  uint64_t count_different(const Same& same) const {
    uint64_t count = 0;
    for (size_t i = 0; i < ours_.size(); ++i) count += same(ours_[i], answers_[i]) ? 0 : 1;
    return count;
  }

  const MemoryScene& scene_;
  const RaySet& set_;
  const MeasureOptions& options_;
  RivalRow row_;
  TeamSorter sorter_;  ///< Embree's
  std::unique_ptr<RayOrder> orders_[kOrderCount];
  LargeVector<RayAnswer> ours_, answers_;
  std::vector<Turns> turns_;
  TeamSeconds all_;  ///< sums over the turns that count
};

}  // namespace

RivalRow measure_rivals(const MemoryScene& scene, const EmbreeScene& usual, const EmbreeScene& compact,
                        const RaySet& set, const MeasureOptions& options) {
  return RivalRun(scene, set, options).run(usual, compact);
}

}  // namespace shoal::bench
