#include "engine/merge_sums.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <nlohmann/json.hpp>

#include "engine/picture_identity.h"
#include "engine/render_report.h"
#include "engine/sums_file.h"

namespace shoal {
namespace {

using Json = nlohmann::json;
using Parts = std::vector<std::unique_ptr<SumsFile>>;

Result<Parts> open_parts(FileSystem& fs, const std::vector<std::string>& paths) {
  if (paths.empty()) return Error{ErrorCode::kInput, "there are no parts to merge"};
  Parts parts;
  for (const std::string& path : paths) {
    SHOAL_ASSIGN_OR_RETURN(auto part, SumsFile::open(fs, path));
    if (part->header().kind != SumsKind::kPart) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is the checkpoint of a render that is not complete: `shoal render "
                               "--resume` goes on from it",
                               path)};
    }
    parts.push_back(std::move(part));
  }
  std::sort(parts.begin(), parts.end(),
            [](const auto& a, const auto& b) { return a->header().range.begin < b->header().range.begin; });
  return parts;
}

bool same_sums(const SumsHeader& a, const SumsHeader& b) {
  return a.width == b.width && a.height == b.height && a.halves == b.halves && a.aovs == b.aovs;
}

bool blue_noise(const std::string& identity) {
  return identity.find("\nsampler blue-noise\n") != std::string::npos;
}

/// Whether they are parts of one picture, which each of its samples is in once.
Status check_parts(const Parts& parts) {
  const SumsFile& first = *parts.front();
  uint32_t samples = 0, done = 0;
  for (const auto& part : parts) samples = std::max(samples, part->header().samples);
  for (size_t i = 0; i < parts.size(); ++i) {
    const SumsFile& part = *parts[i];
    const SumsHeader& header = part.header();
    if (const std::string difference = identity_difference(first.identity(), part.identity());
        !difference.empty()) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is not of the picture of {}: {}", part.path(), first.path(), difference)};
    }
    if (!same_sums(first.header(), header) || header.is_adaptive()) {
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{} is damaged: its header is not that of its picture", part.path())};
    }
    const bool same_numbers =
        !blue_noise(part.identity()) ||
        Sampler::same_numbers(SamplerKind::kBlueNoise, header.samples, samples, SampleSets::kOne);
    if (!same_numbers) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} is of {} samples a pixel, not of {}: with --sampler blue-noise they are "
                               "others",
                               part.path(), header.samples, samples)};
    }
    if (header.range.begin < done) {
      return Error{ErrorCode::kInput,
                   fmt::format("{} and {} both have samples {}:{}", parts[i - 1]->path(), part.path(),
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
  SHOAL_ASSIGN_OR_RETURN(const Parts parts, open_parts(fs, paths));
  SHOAL_RETURN_IF_ERROR(check_parts(parts));
  const SumsHeader& header = parts.front()->header();
  MergedPicture merged;
  merged.image.width = header.width, merged.image.height = header.height;
  SHOAL_RETURN_IF_ERROR(read_attributes(parts.front()->attributes(), merged.image));
  Film film(header.width, header.height);
  std::unique_ptr<AovFilm> aovs;
  if (header.aovs != 0) aovs = std::make_unique<AovFilm>(AovSet{header.aovs}, header.width, header.height);
  for (const auto& part : parts) {
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

std::string attributes_text(const ExrImage& image) {
  // Numbers as their bits: JSON has no NaN and no infinity.
  Json numbers = Json::object(), matrices = Json::object();
  for (const auto& [name, value] : image.numbers) numbers[name] = std::bit_cast<uint32_t>(value);
  for (const auto& [name, matrix] : image.matrices) {
    for (const float value : matrix) matrices[name].push_back(std::bit_cast<uint32_t>(value));
  }
  return Json{{"text", image.text}, {"numbers", numbers}, {"matrices", matrices}}.dump();
}

Status read_attributes(const std::string& text, ExrImage& image) {
  const Error damaged{ErrorCode::kCorrupt, "a part is damaged: its attributes are not what is written"};
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return damaged;
  try {
    json.at("text").get_to(image.text);
    for (const auto& [name, bits] : json.at("numbers").items()) {
      image.numbers[name] = std::bit_cast<float>(bits.get<uint32_t>());
    }
    for (const auto& [name, words] : json.at("matrices").items()) {
      const auto bits = words.get<std::array<uint32_t, 16>>();
      std::transform(bits.begin(), bits.end(), image.matrices[name].begin(),
                     [](uint32_t word) { return std::bit_cast<float>(word); });
    }
  } catch (const Json::exception&) {
    return damaged;
  }
  return {};
}

}  // namespace shoal
