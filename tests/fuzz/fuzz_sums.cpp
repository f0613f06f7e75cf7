// Checkpoints and parts of pictures: they come back from other machines, and from disks that were full. Read as a
// render that goes on reads them, up to the pass that follows, and as `shoal merge` does.
#include "engine/picture_attributes.h"
#include "engine/sums_file.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sums_input.h"
#include "tests/support/memory_file_system.h"

namespace shoal::fuzz {
namespace {

constexpr const char* kPath = "input";

void require_told(const Error& error) {
  using enum ErrorCode;
  require(error.code == kInput || error.code == kCorrupt || error.code == kStorage);
}

/// What a picture has to take them.
struct Sums {
  explicit Sums(const SumsHeader& header) : film(header.width, header.height, header.halves) {
    if (header.aovs != 0) aovs.emplace(AovSet{header.aovs}, header.width, header.height);
    if (header.is_adaptive()) adaptive.emplace(header.width, header.height, NoiseTarget{0.1f, 0.3f}, 1);
  }
  PictureSums all() { return {film, aovs ? &*aovs : nullptr, adaptive ? &*adaptive : nullptr}; }

  Film film;
  std::optional<AovFilm> aovs;
  std::optional<AdaptiveSampling> adaptive;
};

void resolve(Sums& sums) {
  require(sums.film.resolve().size() == size_t{4} * sums.film.width() * sums.film.height());
  if (sums.aovs) (void)sums.aovs->resolve(sums.film);
}

/// Much as engine/render_beginning and engine/render do.
Status go_on(SumsFile& file) {
  const SumsHeader& header = file.header();
  Sums sums(header);
  SHOAL_RETURN_IF_ERROR(file.read_sums(sums.all()));
  std::vector<UnfinishedSample> unfinished(header.unfinished_count);
  SHOAL_RETURN_IF_ERROR(file.read_unfinished(unfinished));
  SHOAL_RETURN_IF_ERROR(file.finish());
  PassPlan passes(header.range.end, 0, header.is_adaptive(), header.is_adaptive() ? 0 : header.range.begin);
  const SampleSpan span = passes.resume(header.pass);
  for (const UnfinishedSample& sample : unfinished) require(sample.pixel < header.width * header.height);
  resolve(sums);
  if (!sums.adaptive) {
    require(SampleOrder(header.width, header.height, span, 1, header.coarse_levels).count() > 0);
    return {};
  }
  require(SampleOrder(header.width, header.height, span, sums.adaptive->blocks()).count() > 0);
  sums.adaptive->end_pass(sums.film, passes.done());
  (void)sums.adaptive->expected_samples(header.samples);
  (void)passes.next(header.seconds, sums.adaptive->drawn_pixels());
  std::vector<float> errors;
  (void)sums.adaptive->finish(sums.film, errors);
  return {};
}

Status add(SumsFile& file) {
  ExrImage image;
  SHOAL_RETURN_IF_ERROR(read_attributes(file.attributes(), image));
  Sums sums(file.header());
  SHOAL_RETURN_IF_ERROR(file.add_sums(sums.all()));
  SHOAL_RETURN_IF_ERROR(file.finish());
  if (sums.film.plausible(file.header().samples) && (!sums.aovs || sums.aovs->plausible())) resolve(sums);
  return {};
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace shoal;
  MemoryFileSystem fs;
  fs.put(fuzz::kPath, fuzz::sums_file_of(fuzz::bytes_of(data, size)));
  const auto file = SumsFile::open(fs, fuzz::kPath);
  if (!file.ok()) {
    fuzz::require_told(file.error());
    return 0;
  }
  const bool checkpoint = file.value()->header().kind == SumsKind::kCheckpoint;
  if (!checkpoint && file.value()->header().is_adaptive()) return 0;  // `shoal merge` refuses it
  const Status status = checkpoint ? fuzz::go_on(*file.value()) : fuzz::add(*file.value());
  if (!status.ok()) fuzz::require_told(status.error());
  return 0;
}
