#include "engine/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "engine/clock.h"
#include "engine/picture_identity.h"

namespace shoal {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

SampleSets sets_of(const PictureOptions& picture) {
  return picture.noise.asked() ? SampleSets::kHalves : SampleSets::kOne;
}

/// What threads hold, and what was to begin again and did not yet.
class AllUnfinished final : public UnfinishedPaths {
 public:
  explicit AllUnfinished(const RenderContext& context) : context_(context) {}
  void each_unfinished(const VisitUnfinished& visit) const override {
    context_.gate.each_unfinished(visit);
    const uint64_t begun = std::min(context_.next_sample - context_.again_first, uint64_t{context_.again.size()});
    for (uint64_t i = begun; i < context_.again.size(); ++i) visit(context_.again[i]);
  }

 private:
  const RenderContext& context_;
};

/// Whether the samples that are asked for can follow those of the checkpoint.
Status check_samples(const SumsFile& file, const PictureOptions& picture) {
  const SumsHeader& header = file.header();
  const SampleSpan range = asked_range(picture);
  if (range.begin != header.range.begin) {
    return Error{ErrorCode::kInput, fmt::format("{} is of samples from {} on, not from {} on", file.path(),
                                                header.range.begin, range.begin)};
  }
  if (range.end < header.pass.span.end) {
    return Error{ErrorCode::kUsage,
                 fmt::format("{} has pixels with {} samples: as many must be asked for at least, found {}",
                             file.path(), header.pass.span.end, range.end)};
  }
  const uint32_t samples = most_samples(picture);
  if (!Sampler::same_numbers(picture.shading.sampler, header.samples, samples, sets_of(picture))) {
    return Error{
        ErrorCode::kUsage,
        fmt::format(
            "{} is of {} samples a pixel: with --sampler blue-noise only as many as have the same power of two "
            "above them can be asked for, found {}",
            file.path(), header.samples, samples)};
  }
  const bool level = header.pass.span.end == std::min(next_level(header.pass.span.begin), samples);
  if (picture.noise.asked() && samples != header.samples && !level) {
    return Error{
        ErrorCode::kUsage,
        fmt::format(
            "{} is in the last pass of {} samples at most: with --target-noise there can be more only before, "
            "found {}",
            file.path(), header.samples, samples)};
  }
  return {};
}

Status check_header(const SumsFile& file, const PictureOptions& picture) {
  const SumsHeader& header = file.header();
  const bool same = header.width == picture.width && header.height == picture.height &&
                    header.aovs == picture.aovs.bits && header.is_adaptive() == picture.noise.asked();
  if (same) return {};
  return Error{ErrorCode::kCorrupt,
               fmt::format("{} is damaged: its header is not that of its picture", file.path())};
}

}  // namespace

Checkpoints::Checkpoints(FileSystem& fs, const CheckpointOptions& options, std::string identity,
                         const SumsHeader& header, const PassPlan& passes, const PictureSums& sums,
                         const std::function<void(const std::string&)>& warning)
    : fs_(fs),
      options_(options),
      identity_(std::move(identity)),
      header_(header),
      passes_(passes),
      sums_(sums),
      warning_(warning),
      due_seconds_(options.every_seconds > 0 ? now_seconds() + options.every_seconds : kNever) {}

void Checkpoints::write_when_due(RenderContext& context, bool stop) {
  if (!stop && now_seconds() < due_seconds_.load(std::memory_order_relaxed)) return;
  context.gate.alone([&] {
    if (context.ended || (!stop && now_seconds() < due_seconds_.load(std::memory_order_relaxed))) return;
    const Status written = write(context);
    if (stop && written.ok()) {
      context.fail(
          {ErrorCode::kStopped, fmt::format("the render was stopped before it was complete; --resume goes on from "
                                            "{}",
                                            options_.path)});
    } else if (stop) {
      context.fail({written.error().code,
                    "the render was stopped, and its checkpoint could not be written: " + written.error().message});
    } else if (!written.ok() && !warned_) {
      if (warning_) warning_("the checkpoint could not be written: " + written.error().message);
      warned_ = true;
    }
    if (options_.every_seconds > 0) due_seconds_ = now_seconds() + options_.every_seconds;
  });
}

Status Checkpoints::write(const RenderContext& context) const {
  SumsHeader header = header_;
  header.pass = passes_.state();
  if (header.pass.span.begin != header.range.begin) header.coarse_levels = 0;  // of the first pass only
  // What is to begin again and did not yet stands before the samples that nobody began at all.
  header.next_sample = std::max(context.next_sample.load(), context.again_first + context.again.size());
  header.samples_before = context.samples_before;
  header.seconds = context.seconds_before + now_seconds() - context.start_seconds;
  const AllUnfinished unfinished(context);
  return write_sums(fs_, options_.path, header, identity_, "", sums_, &unfinished);
}

SampleSpan asked_range(const PictureOptions& picture) {
  return picture.range.count() > 0 ? picture.range : SampleSpan{0, most_samples(picture)};
}

uint32_t most_samples(const PictureOptions& picture) {
  return picture.noise.asked() ? std::max(picture.samples & ~1u, 2u) : picture.samples;
}

SumsHeader sums_header(const PictureOptions& picture, SumsKind kind) {
  SumsHeader header;
  header.kind = kind;
  header.samples = most_samples(picture);
  header.range = asked_range(picture);
  return header;
}

Result<std::unique_ptr<SumsFile>> open_checkpoint(FileSystem& fs, const std::string& path,
                                                  const std::string& identity, const PictureOptions& picture) {
  SHOAL_ASSIGN_OR_RETURN(auto file, SumsFile::open(fs, path));
  if (file->header().kind != SumsKind::kCheckpoint) {
    return Error{ErrorCode::kInput, fmt::format("{} is a part of a picture, not a checkpoint", path)};
  }
  if (const std::string difference = identity_difference(identity, file->identity()); !difference.empty()) {
    return Error{ErrorCode::kInput,
                 fmt::format("{} is of another picture: {}. Ask for the same, or remove it to start afresh", path,
                             difference)};
  }
  SHOAL_RETURN_IF_ERROR(check_header(*file, picture));
  SHOAL_RETURN_IF_ERROR(check_samples(*file, picture));
  return file;
}

Status resume_cursor(SumsFile& file, RenderContext& context) {
  const SumsHeader& header = file.header();
  if (header.next_sample > context.samples.count()) {
    return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged: its pass has {} samples, found {} begun",
                                                  file.path(), context.samples.count(), header.next_sample)};
  }
  context.again.resize(header.unfinished_count);
  SHOAL_RETURN_IF_ERROR(file.read_unfinished(context.again));
  SHOAL_RETURN_IF_ERROR(file.finish());
  context.seconds_before = header.seconds;
  context.again_first = file.done_in_pass();
  context.next_sample = context.samples_done = context.end_sample = context.again_first;
  context.samples_before = header.samples_before;
  context.samples_restored = context.all_samples_done();
  return {};
}

}  // namespace shoal
