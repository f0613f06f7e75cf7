#include "engine/accuracy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/accuracy_plan.h"
#include "engine/accuracy_views.h"
#include "engine/clock.h"
#include "engine/flip.h"
#include "engine/pareto_front.h"

namespace shoal {
namespace {

constexpr uint32_t kReferenceParts = 4;

/// Numbers far apart, so that no two renders share random numbers (SplitMix64, Steele, Lea, Flood 2014).
uint64_t spread_seed(uint64_t seed, uint64_t role, uint64_t index) {
  uint64_t x = seed * 0x9e3779b97f4a7c15u + (role << 32) + index + 1;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
  x = (x ^ x >> 27) * 0x94d049bb133111ebu;
  return x ^ x >> 31;
}
enum SeedRole : uint64_t { kRowSeeds = 1, kReferenceSeeds = 2, kPilotSeeds = 3 };

RgbPicture rgb_of(const std::vector<float>& rgba) {
  RgbPicture rgb(rgba.size() / 4 * 3);
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = rgba[i / 3 * 4 + i % 3];
  return rgb;
}

double ratio(uint64_t a, uint64_t b) { return b == 0 ? 0 : static_cast<double>(a) / static_cast<double>(b); }

/// A row before it is measured.
struct PlannedRow {
  std::string knob, value;
  AccuracySettings settings;
};

/// What one picture of a row leaves.
struct TakenPicture {
  RgbPicture rgb;
  double seconds = 0;
  uint64_t disk_read_bytes = 0;
  std::string order;
};

class Measurement {
 public:
  Measurement(FileSystem& fs, const Scene& scene, const AccuracyJob& job, const AccuracyHooks& hooks)
      : fs_(fs), job_(job), hooks_(hooks), base_scene_{&scene, job.execution, job.build_seconds},
        start_(now_seconds()) {}

  Status run() {
    SHOAL_RETURN_IF_ERROR(settle_sizes());
    SHOAL_RETURN_IF_ERROR(settle_reference());
    SHOAL_RETURN_IF_ERROR(measure({"base", "", base_}));
    SHOAL_ASSIGN_OR_RETURN(control_seconds_, take_control());
    for (const AccuracyKnob& knob : result.knobs) SHOAL_RETURN_IF_ERROR(measure_knob(knob));
    SHOAL_RETURN_IF_ERROR(measure_together());
    mark_front();
    choose_pictures();
    result.total_seconds = now_seconds() - start_;
    return {};
  }

  AccuracyResult result;

 private:
  double spent() const { return now_seconds() - start_; }

  Result<TakenPicture> take(const AccuracyScene& scene, const AccuracySettings& settings, uint64_t seed,
                            const std::string& stage) {
    PictureOptions picture = settings.picture;
    picture.shading.seed = seed;
    RenderHooks hooks;
    hooks.stop = hooks_.stop;
    const uint64_t samples = picture.samples;
    if (hooks_.progress) {
      hooks.progress = [&, samples](const RenderProgress& p) {
        const double share = static_cast<double>(p.samples_done) / static_cast<double>(p.samples_total);
        const double done = (static_cast<double>(samples_done_) + share * static_cast<double>(samples)) /
                            static_cast<double>(std::max<uint64_t>(samples_total_, 1));
        hooks_.progress(stage, std::min(done, 1.0), spent());
      };
    }
    SHOAL_ASSIGN_OR_RETURN(RenderResult taken, render(fs_, *scene.scene, picture, scene.execution, hooks));
    samples_done_ += samples;
    return TakenPicture{rgb_of(taken.rgba), taken.seconds, taken.counters.disk_read_bytes,
                        std::string(order_name(taken.order.order))};
  }

  /// Two short renders of a small picture say how large everything may be.
  Status settle_sizes() {
    result.asked = result.sizes = job_.sizes;
    result.seeds = job_.seeds, result.budget_seconds = job_.budget_seconds;
    base_ = job_.base;
    base_.picture.width = job_.sizes.width, base_.picture.height = job_.sizes.height;
    base_.picture.samples = job_.sizes.samples;
    SHOAL_RETURN_IF_ERROR(choose_knobs(accuracy_knobs(base_), job_.knobs));
    if (job_.budget_seconds > 0) {
      constexpr uint32_t kFew = 1, kMore = 4, kPilotSide = 192;
      AccuracySettings pilot = base_;
      const double scale = std::min(1.0, static_cast<double>(kPilotSide) / std::max(base_.picture.width, base_.picture.height));
      pilot.picture.width = std::max(1u, static_cast<uint32_t>(base_.picture.width * scale));
      pilot.picture.height = std::max(1u, static_cast<uint32_t>(base_.picture.height * scale));
      double seconds[2];
      for (uint32_t i = 0; i < 2; ++i) {
        pilot.picture.samples = i == 0 ? kFew : kMore;
        SHOAL_ASSIGN_OR_RETURN(const TakenPicture taken,
                               take(base_scene_, pilot, spread_seed(job_.base.picture.shading.seed, kPilotSeeds, i), "pilot"));
        seconds[i] = taken.seconds;
      }
      const RenderPace pace = pace_of(uint64_t{pilot.picture.width} * pilot.picture.height, kFew, seconds[0], kMore, seconds[1]);
      result.sizes = fit_budget(job_, pace, job_.budget_seconds - spent(), !job_.reference.empty());
    }
    base_.picture.width = result.sizes.width, base_.picture.height = result.sizes.height;
    base_.picture.samples = result.sizes.samples;
    SHOAL_ASSIGN_OR_RETURN(result.knobs, choose_knobs(accuracy_knobs(base_), job_.knobs));
    samples_done_ = 0;
    samples_total_ = accuracy_work(result.knobs, base_, job_.seeds,
                                   job_.reference.empty() ? result.sizes.reference_samples : 0).samples;
    return {};
  }

  Status settle_reference() {
    result.reference_given = !job_.reference.empty();
    if (result.reference_given) {
      reference_ = reference_of(base_.picture.width, base_.picture.height, {job_.reference});
      reference_.variance = job_.reference_variance;
    } else {
      SHOAL_RETURN_IF_ERROR(render_reference());
    }
    result.reference_noise = reference_.relative_noise();
    result.reference_noise_known = reference_.noise_known();
    result.exposure = job_.exposure ? *job_.exposure : middle_exposure(reference_.mean);
    tone_ = {job_.curve, result.exposure};
    flip_.emplace(base_.picture.width, base_.picture.height, displayed(reference_.mean, tone_));
    return {};
  }

  Status render_reference() {
    AccuracySettings truth = base_;
    set_truth(accuracy_knobs(base_), truth);
    truth.picture.samples = std::max(result.sizes.reference_samples / kReferenceParts, 1u);
    SHOAL_ASSIGN_OR_RETURN(const AccuracyScene scene, scene_of(truth));
    std::vector<RgbPicture> parts;
    for (uint32_t part = 0; part < kReferenceParts; ++part) {
      const uint64_t seed = spread_seed(job_.base.picture.shading.seed, kReferenceSeeds, part);
      SHOAL_ASSIGN_OR_RETURN(TakenPicture taken, take(scene, truth, seed, "reference"));
      result.reference_seconds += taken.seconds;
      parts.push_back(std::move(taken.rgb));
    }
    reference_ = reference_of(base_.picture.width, base_.picture.height, std::move(parts));
    return {};
  }

  /// The scene built as these settings ask: the one at hand where no build option differs, or where it cannot be built.
  Result<AccuracyScene> scene_of(const AccuracySettings& settings) {
    std::vector<size_t> asked, own;
    for (const AccuracyKnob& knob : accuracy_knobs(base_)) {
      if (knob.rebuilds) asked.push_back(knob.value_of(settings)), own.push_back(knob.value_of(base_));
    }
    if (asked == own || !job_.may_rebuild || !hooks_.open) {
      if (hooks_.close) hooks_.close();
      return base_scene_;
    }
    return hooks_.open([&settings, knobs = accuracy_knobs(base_)](SceneBuildOptions& options) {
      AccuracySettings changed = settings;
      changed.build = options;
      for (const AccuracyKnob& knob : knobs) {
        const size_t value = knob.value_of(settings);
        if (knob.rebuilds && value != AccuracyKnob::kNoValue) knob.values[value].apply(changed);
      }
      options = changed.build;
    });
  }

  Status measure_knob(const AccuracyKnob& knob) {
    if (knob.rebuilds && !job_.may_rebuild) {
      result.left_out.push_back(knob.name + ": a .shoal cannot be built anew; give the glTF");
      return {};
    }
    for (size_t i = 0; i < knob.values.size(); ++i) {
      if (i == knob.value_of(base_)) continue;
      PlannedRow row{knob.name, knob.values[i].name, base_};
      knob.values[i].apply(row.settings);
      SHOAL_RETURN_IF_ERROR(measure_within_budget(row));
    }
    return {};
  }

  Status measure_within_budget(const PlannedRow& row) {
    constexpr double kOverrun = 1.5;  // a prediction from two short renders may be that far off
    if (job_.budget_seconds > 0 && spent() > kOverrun * job_.budget_seconds) {
      result.left_out.push_back(fmt::format("{} {}: the budget of {:.0f} s was spent", row.knob, row.value, job_.budget_seconds));
      return {};
    }
    return measure(row);
  }

  /// Knobs turned together: each to its best for the time, and each to its most accurate; with fewer and more samples.
  Status measure_together() {
    AccuracySettings best = base_, truth = base_;
    bool better = false;
    for (const AccuracyKnob& knob : result.knobs) {
      const AccuracyRow* winner = best_for_time(knob);
      if (winner == nullptr) continue;
      for (const KnobValue& value : knob.values) {
        if (value.name == winner->value) value.apply(best), better = true;
      }
    }
    set_truth(result.knobs, truth);
    if (better) {
      SHOAL_RETURN_IF_ERROR(measure_with_samples("best for the time", best));
    } else {
      result.left_out.push_back("best for the time: no value of a knob beats the base for the same time");
    }
    const bool differs = std::any_of(result.knobs.begin(), result.knobs.end(), [&](const AccuracyKnob& knob) {
      return knob.value_of(truth) != knob.value_of(base_);
    });
    return differs ? measure_with_samples("most accurate", truth) : Status{};
  }

  Status measure_with_samples(const std::string& name, AccuracySettings settings) {
    const uint32_t own = base_.picture.samples;
    for (const uint32_t samples : {own / 4, own, own * 4}) {
      if (samples == 0 || samples > (1u << 22)) continue;
      settings.picture.samples = samples;
      SHOAL_RETURN_IF_ERROR(measure_within_budget({"together", fmt::format("{}, {} spp", name, samples), settings}));
    }
    return {};
  }

  /// The row of a knob with the least error in the time of the base; null where the base itself has it, or nearly.
  const AccuracyRow* best_for_time(const AccuracyKnob& knob) const {
    if (knob.name == kSamplesKnob) return nullptr;
    constexpr double kClearly = 0.95;
    const double time = result.base().seconds;
    double least = kClearly * result.base().error_in(time);
    const AccuracyRow* winner = nullptr;
    for (const AccuracyRow& row : result.rows) {
      if (row.knob != knob.name || !(row.error_in(time) < least)) continue;
      least = row.error_in(time), winner = &row;
    }
    return winner;
  }

  Status measure(const PlannedRow& planned) {
    SHOAL_ASSIGN_OR_RETURN(const AccuracyScene scene, scene_of(planned.settings));
    AccuracyRow row;
    row.knob = planned.knob, row.value = planned.value;
    row.base = planned.knob == "base";
    row.name = row.base ? "base" : row.knob == "together" ? row.value : row.knob + " " + row.value;
    row.samples = planned.settings.picture.samples;
    for (const AccuracyKnob& knob : result.knobs) {
      const size_t value = knob.value_of(planned.settings);
      row.settings.push_back(value == AccuracyKnob::kNoValue ? "other" : knob.values[value].name);
    }
    std::vector<TakenPicture> taken;
    for (uint32_t seed = 0; seed < job_.seeds; ++seed) {
      const uint64_t number = spread_seed(job_.base.picture.shading.seed, kRowSeeds, seed);
      SHOAL_ASSIGN_OR_RETURN(TakenPicture picture, take(scene, planned.settings, number, row.name));
      taken.push_back(std::move(picture));
    }
    row.build_seconds = scene.build_seconds;
    row.file_bytes = scene.scene->file->file_bytes();
    row.bytes_a_triangle = ratio(row.file_bytes, scene.scene->header.triangles_count);
    if (!row.base) SHOAL_RETURN_IF_ERROR(note_pace(row));  // the scene of the row is closed then
    note_times(taken, row);
    note_errors(std::move(taken), row);
    result.rows.push_back(std::move(row));
    return {};
  }

  /// Seconds of the base, now.
  Result<double> take_control() {
    SHOAL_ASSIGN_OR_RETURN(const AccuracyScene scene, scene_of(base_));
    const uint64_t seed = spread_seed(job_.base.picture.shading.seed, kRowSeeds, 0);
    SHOAL_ASSIGN_OR_RETURN(const TakenPicture taken, take(scene, base_, seed, "base"));
    return taken.seconds;
  }

  /// The base stands between every two rows: what else the machine does changes while they are rendered, and a row must not
  /// be called slow for that.
  Status note_pace(AccuracyRow& row) {
    const double before = control_seconds_;
    SHOAL_ASSIGN_OR_RETURN(control_seconds_, take_control());
    row.machine_pace = (before + control_seconds_) / 2 / result.base().seconds;
    return {};
  }

  static void note_times(const std::vector<TakenPicture>& taken, AccuracyRow& row) {
    std::vector<const TakenPicture*> by_time;
    for (const TakenPicture& picture : taken) by_time.push_back(&picture);
    std::sort(by_time.begin(), by_time.end(), [](auto* a, auto* b) { return a->seconds < b->seconds; });
    const TakenPicture& median = *by_time[(by_time.size() - 1) / 2];
    row.seconds = median.seconds / row.machine_pace;
    row.seconds_min = by_time.front()->seconds / row.machine_pace;
    row.seconds_max = by_time.back()->seconds / row.machine_pace;
    row.disk_read_bytes = median.disk_read_bytes, row.order = median.order;
  }

  void note_errors(std::vector<TakenPicture> taken, AccuracyRow& row) {
    std::vector<RgbPicture> pictures;
    for (TakenPicture& picture : taken) pictures.push_back(std::move(picture.rgb));
    const double count = static_cast<double>(pictures.size());
    std::vector<double> errors;
    for (size_t i = 0; i < pictures.size(); ++i) {
      const RelativeError error = relative_error(pictures[i], reference_.mean);
      errors.push_back(error.trimmed);
      row.rel_mse += error.trimmed / count, row.rel_mse_all += error.all / count;
      const std::vector<float> map = flip_->compare(displayed(pictures[i], tone_));
      row.flip += mean_value(map) / count;
      if (i == 0) note_view(pictures[i], map, row);
    }
    const auto [least, most] = std::minmax_element(errors.begin(), errors.end());
    row.rel_mse_min = *least, row.rel_mse_max = *most;
    row.error = noise_and_bias(base_.picture.width, base_.picture.height, pictures, reference_);
    const auto efficiency = [&](double variance) { return variance > 0 ? 1 / (variance * row.seconds) : 0; };
    const Estimate& variance = row.error.variance;
    row.efficiency = {efficiency(variance.value), efficiency(variance.high), efficiency(variance.low)};
  }

  /// Keeps the crop of a row's first picture; the base, which comes first, says where it is.
  void note_view(const RgbPicture& picture, const std::vector<float>& map, const AccuracyRow& row) {
    const uint32_t width = base_.picture.width;
    if (row.base) {
      crop_ = worst_crop(width, base_.picture.height, map);
      result.crop_x = crop_.x, result.crop_y = crop_.y;
      result.pictures.push_back({"reference", AccuracyPicture::kReferenceRow, crop_.width, crop_.height,
                                 crop_colors(reference_.mean, width, crop_, tone_), {}, 0});
    }
    result.pictures.push_back({row.name, result.rows.size(), crop_.width, crop_.height,
                               crop_colors(picture, width, crop_, tone_), crop_errors(map, width, crop_),
                               crop_mean(map, width, crop_)});
  }

  void mark_front() {
    std::vector<PricedError> choices;
    for (const AccuracyRow& row : result.rows) choices.push_back({row.seconds, row.rel_mse});
    const std::vector<bool> front = pareto_front(choices);
    for (size_t i = 0; i < front.size(); ++i) result.rows[i].pareto = front[i];
  }

  /// Of a knob's rows the first and the last; of the others all.
  void choose_pictures() {
    std::erase_if(result.pictures, [&](const AccuracyPicture& picture) {
      if (picture.row == AccuracyPicture::kReferenceRow) return false;
      const std::string& knob = result.rows[picture.row].knob;
      const bool first = picture.row == 0 || result.rows[picture.row - 1].knob != knob;
      const bool last = picture.row + 1 == result.rows.size() || result.rows[picture.row + 1].knob != knob;
      return !first && !last;
    });
  }

  FileSystem& fs_;
  const AccuracyJob& job_;
  const AccuracyHooks& hooks_;
  AccuracyScene base_scene_;
  double start_;
  AccuracySettings base_;
  ReferencePicture reference_;
  ToneMapOptions tone_;
  std::optional<FlipReference> flip_;
  CropPlace crop_;
  uint64_t samples_done_ = 0, samples_total_ = 0;
  double control_seconds_ = 0;  ///< of the base, when it was rendered last
};

}  // namespace

double AccuracyRow::bias() const { return std::sqrt(std::max(error.bias_squared.value, 0.0)); }

double AccuracyRow::error_in(double other_seconds) const {
  return (error.biased ? std::max(error.bias_squared.value, 0.0) : 0) + error.variance.value * seconds / other_seconds;
}

const AccuracyRow* AccuracyResult::find(const std::string& knob, const std::string& value) const {
  const size_t at = static_cast<size_t>(
      std::find_if(knobs.begin(), knobs.end(), [&](const AccuracyKnob& k) { return k.name == knob; }) - knobs.begin());
  for (const AccuracyRow& row : rows) {
    const bool base = row.base && at < knobs.size() && row.settings[at] == value;
    if (base || (row.knob == knob && row.value == value)) return &row;
  }
  return nullptr;
}

Result<AccuracyResult> measure_accuracy(FileSystem& fs, const Scene& scene, const AccuracyJob& job,
                                        const AccuracyHooks& hooks) {
  SHOAL_CHECK(job.seeds >= kFewestSeeds);
  Measurement measurement(fs, scene, job, hooks);
  SHOAL_RETURN_IF_ERROR(measurement.run());
  return std::move(measurement.result);
}

uint32_t accuracy_kept_pictures(uint32_t seeds) {
  // Floats a pixel: the parts of the reference, their mean and weights, its display and its variance, three each; what
  // FLIP keeps of it; three a seed.
  const uint32_t floats = 3 * (kReferenceParts + 4) + 5 + 3 * seeds;
  return (floats + 3) / 4;
}

}  // namespace shoal
