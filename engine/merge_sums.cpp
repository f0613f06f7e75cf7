#include "engine/merge_sums.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "engine/picture_attributes.h"
#include "engine/picture_identity.h"
#include "engine/render_report.h"
#include "engine/sums_file.h"

namespace shoal {
namespace {

/// Of every part only this stays: there may be more of them than files can be open at once.
struct Part {
  std::string path;
  SumsHeader header;
};
struct Parts {
  std::vector<Part> parts;  ///< by their ranges
  std::string identity;     ///< of them all
};

Result<Parts> look_at_parts(FileSystem& fs, const std::vector<std::string>& paths) {
  if (paths.empty()) return Error{ErrorCode::kInput, "there are no parts to merge"};
  Parts all;
  for (const std::string& path : paths) {
    SHOAL_ASSIGN_OR_RETURN(const auto part, SumsFile::open(fs, path));
    if (part->header().kind != SumsKind::kPart) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is the checkpoint of a render that is not complete: `shoal render "
                               "--resume` goes on from it",
                               path)};
    }
    if (all.parts.empty()) all.identity = part->identity();
    if (const std::string difference = identity_difference(all.identity, part->identity()); !difference.empty()) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is not of the picture of {}: {}", path, paths.front(), difference)};
    }
    all.parts.push_back({path, part->header()});
  }
  std::sort(all.parts.begin(), all.parts.end(),
            [](const Part& a, const Part& b) { return a.header.range.begin < b.header.range.begin; });
  return all;
}

/// Once more, when its turn has come.
Result<std::unique_ptr<SumsFile>> reopen(FileSystem& fs, const Part& part) {
  SHOAL_ASSIGN_OR_RETURN(auto file, SumsFile::open(fs, part.path));
  if (file->header().checksum != part.header.checksum) {
    return Error{ErrorCode::kInput, fmt::format("{} was written anew while parts were merged", part.path)};
  }
  return file;
}

bool same_sums(const SumsHeader& a, const SumsHeader& b) {
  return a.width == b.width && a.height == b.height && a.halves == b.halves && a.aovs == b.aovs;
}

bool blue_noise(const std::string& identity) {
  return identity.find("\nsampler blue-noise\n") != std::string::npos;
}

/// Whether they are parts of one picture, which each of its samples is in once.
Status check_parts(const Parts& all) {
  const std::vector<Part>& parts = all.parts;
  uint32_t samples = 0, done = 0;
  for (const Part& part : parts) samples = std::max(samples, part.header.samples);
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto& [path, header] = parts[i];
    if (!same_sums(parts.front().header, header) || header.is_adaptive()) {
      return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged: its header is not that of its picture", path)};
    }
    const bool same_numbers =
        !blue_noise(all.identity) ||
        Sampler::same_numbers(SamplerKind::kBlueNoise, header.samples, samples, SampleSets::kOne);
    if (!same_numbers) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is of {} samples a pixel, not of {}: with --sampler blue-noise they are "
                               "others",
                               path, header.samples, samples)};
    }
    if (header.range.begin < done) {
      return Error{ErrorCode::kInput, fmt::format("{} and {} both have samples {}:{}", parts[i - 1].path, path,
                                                  header.range.begin, std::min(done, header.range.end))};
    }
    if (header.range.begin > done) {
      return Error{ErrorCode::kInput, fmt::format("samples {}:{} are in no part", done, header.range.begin)};
    }
    done = header.range.end;
  }
  if (done < samples) return Error{ErrorCode::kInput, fmt::format("samples {}:{} are in no part", done, samples)};
  return {};
}

}  // namespace

Result<MergedPicture> merge_parts(FileSystem& fs, const std::vector<std::string>& paths) {
  SHOAL_ASSIGN_OR_RETURN(const Parts all, look_at_parts(fs, paths));
  SHOAL_RETURN_IF_ERROR(check_parts(all));
  const SumsHeader& header = all.parts.front().header;
  MergedPicture merged;
  merged.image.width = header.width, merged.image.height = header.height;
  Film film(header.width, header.height);
  std::unique_ptr<AovFilm> aovs;
  if (header.aovs != 0) aovs = std::make_unique<AovFilm>(AovSet{header.aovs}, header.width, header.height);
  for (const Part& seen : all.parts) {
    SHOAL_ASSIGN_OR_RETURN(const auto part, reopen(fs, seen));
    if (&seen == &all.parts.front() && !read_attributes(part->attributes(), merged.image).ok()) {
      return Error{ErrorCode::kCorrupt, fmt::format("{} is damaged: its attributes are not what is written", seen.path)};
    }
    SHOAL_RETURN_IF_ERROR(part->add_sums({film, aovs.get(), nullptr}));
    SHOAL_RETURN_IF_ERROR(part->finish());
    merged.samples = part->header().range.end;
    merged.seconds += part->header().seconds;
    if (!film.plausible(merged.samples) || (aovs != nullptr && !aovs->plausible())) {
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{} is damaged: its sums are not of so many samples", part->path())};
    }
  }
  add_channels(film.resolve(), aovs != nullptr ? aovs->resolve(film) : std::vector<ExrChannel>{}, merged.image);
  merged.image.numbers["renderTimeSeconds"] = static_cast<float>(merged.seconds);
  merged.image.numbers["samplesPerPixel"] = static_cast<float>(merged.samples);
  return merged;
}

}  // namespace shoal
