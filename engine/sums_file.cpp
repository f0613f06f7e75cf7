#include "engine/sums_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "engine/path_ray.h"

namespace shoal {
namespace {

/// Written, hashed and read at once.
constexpr uint64_t kBlockBytes = 1u << 20;
/// Options are words and numbers.
constexpr uint32_t kMostTextBytes = 64u << 10;
constexpr uint32_t kMostSamples = 1u << 22;  // check_picture()

static_assert(std::endian::native == std::endian::little, "sums are stored as they are in memory");
static_assert(sizeof(PassPlan::State) == 32 && offsetof(SumsHeader, adaptive) == 128);

uint64_t hash_of(std::span<const std::byte> bytes) {
  ContentHash hash;
  hash.add(bytes);
  return hash.value();
}

uint64_t hash_of(const std::string& text) { return hash_of(std::as_bytes(std::span(text))); }

uint64_t header_checksum(const SumsHeader& header) {
  return hash_of(std::as_bytes(std::span(&header, 1)).first(offsetof(SumsHeader, checksum)));
}

/// Hashes what it writes.
class SumsWriter {
 public:
  explicit SumsWriter(AtomicFile file) : file_(std::move(file)) {}

  Status write(std::span<const std::byte> bytes) {
    for (size_t at = 0; at < bytes.size(); at += kBlockBytes) {
      const auto block = bytes.subspan(at, std::min<size_t>(kBlockBytes, bytes.size() - at));
      hash_.add(block);
      SHOAL_RETURN_IF_ERROR(file_.append(block));
    }
    return {};
  }
  Status write(const std::string& text) { return write(std::as_bytes(std::span(text))); }

  Status finish() {
    const uint64_t hash = hash_.value();
    SHOAL_RETURN_IF_ERROR(file_.append(std::as_bytes(std::span(&hash, 1))));
    return file_.commit();
  }

 private:
  AtomicFile file_;
  ContentHash hash_;
};

Status write_unfinished(SumsWriter& writer, const UnfinishedPaths& unfinished) {
  std::vector<UnfinishedSample> block;
  block.reserve(kBlockBytes / sizeof(UnfinishedSample));
  Status status;
  const auto flush = [&] {
    if (status.ok()) status = writer.write(std::as_bytes(std::span(block)));
    block.clear();
  };
  unfinished.each_unfinished([&](const UnfinishedSample& sample) {
    block.push_back(sample);
    if (block.size() == block.capacity()) flush();
  });
  flush();
  return status;
}

}  // namespace

uint64_t sums_file_bytes(const SumsHeader& header) {
  uint64_t bytes = sizeof(SumsHeader) + header.identity_bytes + header.attributes_bytes + sizeof(uint64_t);
  bytes += uint64_t{header.width} * header.height * header.halves * Film::kPixelBytes;
  bytes += AovFilm::plane_bytes({header.aovs}, header.width, header.height);
  if (header.is_adaptive()) {
    bytes += AdaptiveSampling::parts_bytes(header.width, header.height, header.adaptive.drawn_count);
  }
  return bytes + header.unfinished_count * sizeof(UnfinishedSample);
}

Status write_sums(FileSystem& fs, const std::string& path, SumsHeader header, const std::string& identity,
                  const std::string& attributes, const PictureSums& sums, const UnfinishedPaths* unfinished) {
  header.width = sums.film.width(), header.height = sums.film.height();
  header.halves = sums.adaptive != nullptr ? 2 : 1;
  header.aovs = sums.aovs != nullptr ? sums.aovs->set().bits : 0;
  header.identity_bytes = static_cast<uint32_t>(identity.size());
  header.attributes_bytes = static_cast<uint32_t>(attributes.size());
  header.identity_hash = hash_of(identity);
  if (sums.adaptive != nullptr) header.adaptive = sums.adaptive->numbers();
  header.unfinished_count = 0;
  if (unfinished != nullptr)
    unfinished->each_unfinished([&](const UnfinishedSample&) { ++header.unfinished_count; });
  header.checksum = header_checksum(header);
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(fs, path));
  SumsWriter writer(std::move(file));
  SHOAL_RETURN_IF_ERROR(writer.write(std::as_bytes(std::span(&header, 1))));
  SHOAL_RETURN_IF_ERROR(writer.write(identity));
  SHOAL_RETURN_IF_ERROR(writer.write(attributes));
  SHOAL_RETURN_IF_ERROR(writer.write(sums.film.raw()));
  if (sums.aovs != nullptr) {
    for (const AovFilm::Plane& plane : sums.aovs->planes()) SHOAL_RETURN_IF_ERROR(writer.write(plane.bytes));
  }
  if (sums.adaptive != nullptr) {
    for (const std::span<std::byte> part : sums.adaptive->parts()) SHOAL_RETURN_IF_ERROR(writer.write(part));
  }
  if (unfinished != nullptr) SHOAL_RETURN_IF_ERROR(write_unfinished(writer, *unfinished));
  return writer.finish();
}

SumsFile::SumsFile(std::unique_ptr<ReadableFile> file, std::string path)
    : file_(std::move(file)), path_(std::move(path)) {}

Error SumsFile::damaged(const std::string& what) const {
  return {ErrorCode::kCorrupt, fmt::format("{} is damaged: {}", path_, what)};
}

Status SumsFile::check_header() const {
  const SumsHeader& h = header_;
  if (h.kind != SumsKind::kCheckpoint && h.kind != SumsKind::kPart) return damaged("it is of no known kind");
  const bool size = h.width > 0 && h.height > 0 && h.width <= 65536 && h.height <= 65536 &&
                    uint64_t{h.width} * h.height < (1ull << 31);
  const bool samples =
      h.samples > 0 && h.samples <= kMostSamples && h.range.begin < h.range.end && h.range.end <= h.samples;
  const bool pass =
      h.kind == SumsKind::kPart || (h.range.begin <= h.pass.span.begin && h.pass.span.begin < h.pass.span.end &&
                                    h.pass.span.end <= h.range.end && h.pass.pixels > 0 && h.pass.began >= 0);
  // Samples in hand belong to paths in flight; a thread has a few more.
  const bool unfinished = h.unfinished_count <= h.next_sample && h.unfinished_count <= 2ull * kMaxPathsInFlight &&
                          (h.kind == SumsKind::kCheckpoint || h.unfinished_count == 0);
  const bool rest = (h.halves == 1 || h.halves == 2) && h.aovs < 1u << kAovCount &&
                    h.identity_bytes <= kMostTextBytes && h.attributes_bytes <= kMostTextBytes && h.seconds >= 0 &&
                    h.coarse_levels <= SampleOrder::kAllLevels;
  if (!size || !samples || !pass || !unfinished || !rest) return damaged("its header makes no sense");
  if (file_->size_bytes() == sums_file_bytes(h)) return {};
  return damaged(fmt::format("expected {} bytes, found {}", sums_file_bytes(h), file_->size_bytes()));
}

Result<std::unique_ptr<SumsFile>> SumsFile::open(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.open(path, ReadMode::kBuffered));
  const uint64_t bytes = file->size_bytes();
  std::unique_ptr<SumsFile> sums(new SumsFile(std::move(file), path));
  SumsHeader& header = sums->header_;
  if (bytes < sizeof(SumsHeader)) {
    return Error{ErrorCode::kInput,
                 fmt::format("{} is no checkpoint and no part of a picture: expected {} bytes at least, "
                             "found {}",
                             path, sizeof(SumsHeader), bytes)};
  }
  SHOAL_RETURN_IF_ERROR(sums->read(std::as_writable_bytes(std::span(&header, 1))));
  if (header.magic != kSumsMagic) {
    return Error{ErrorCode::kInput, fmt::format("{} is no checkpoint and no part of a picture", path)};
  }
  if (header.version != kSumsVersion || header.endian_mark != SumsHeader{}.endian_mark) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected version {}, found {}", path, kSumsVersion, header.version)};
  }
  if (header.checksum != header_checksum(header)) return sums->damaged("the checksum of its header is wrong");
  SHOAL_RETURN_IF_ERROR(sums->check_header());
  sums->identity_.resize(header.identity_bytes);
  sums->attributes_.resize(header.attributes_bytes);
  SHOAL_RETURN_IF_ERROR(sums->read(std::as_writable_bytes(std::span(sums->identity_))));
  SHOAL_RETURN_IF_ERROR(sums->read(std::as_writable_bytes(std::span(sums->attributes_))));
  if (hash_of(sums->identity_) != header.identity_hash)
    return sums->damaged("what it says of its picture is not what was written");
  return sums;
}

Status SumsFile::read(std::span<std::byte> out) {
  for (size_t at = 0; at < out.size(); at += kBlockBytes) {
    const auto block = out.subspan(at, std::min<size_t>(kBlockBytes, out.size() - at));
    SHOAL_RETURN_IF_ERROR(file_->read_at(at_, block));
    hash_.add(block);
    at_ += block.size();
  }
  return {};
}

/// `whole`: blocks hold whole numbers of so many bytes.
template <class Add>
Status SumsFile::read_in_blocks(uint64_t bytes, uint64_t whole, const Add& add) {
  std::vector<std::byte> block(std::min(bytes, kBlockBytes / whole * whole));
  for (uint64_t at = 0; at < bytes; at += block.size()) {
    const auto part = std::span(block).first(std::min<uint64_t>(block.size(), bytes - at));
    SHOAL_RETURN_IF_ERROR(read(part));
    add(at, part);
  }
  return {};
}

Status SumsFile::read_sums(const PictureSums& sums) {
  SHOAL_RETURN_IF_ERROR(read(sums.film.raw()));
  bool plausible = sums.film.plausible(header_.range.end - header_.range.begin);
  if (sums.aovs != nullptr) {
    for (const AovFilm::Plane& plane : sums.aovs->planes()) SHOAL_RETURN_IF_ERROR(read(plane.bytes));
    plausible = plausible && sums.aovs->plausible();
  }
  if (sums.adaptive != nullptr) {
    if (!sums.adaptive->take(header_.adaptive)) return damaged("it has more blocks than the picture");
    for (const std::span<std::byte> part : sums.adaptive->parts()) SHOAL_RETURN_IF_ERROR(read(part));
    plausible = plausible && sums.adaptive->plausible(header_.pass.span.begin);
  }
  if (!plausible) return damaged("its sums are not of so many samples");
  return {};
}

Status SumsFile::add_sums(const PictureSums& sums) {
  SHOAL_RETURN_IF_ERROR(read_in_blocks(sums.film.raw().size(), Film::kPixelBytes,
                                       [&](uint64_t at, auto bytes) { sums.film.add_raw(at, bytes); }));
  if (sums.aovs == nullptr) return {};
  constexpr uint64_t kEverySum = 48;  // 4, 8, 16 and 24 bytes
  for (const AovFilm::Plane& plane : sums.aovs->planes()) {
    SHOAL_RETURN_IF_ERROR(read_in_blocks(plane.bytes.size(), kEverySum, [&](uint64_t at, auto bytes) {
      sums.aovs->add_plane(plane.aov, at, bytes);
    }));
  }
  return {};
}

Status SumsFile::read_unfinished(std::span<UnfinishedSample> samples) {
  SHOAL_RETURN_IF_ERROR(read(std::as_writable_bytes(samples)));
  const uint64_t pixels = uint64_t{header_.width} * header_.height;
  const SampleSpan& span = header_.pass.span;
  const bool good = std::all_of(samples.begin(), samples.end(), [&](const UnfinishedSample& s) {
    return s.pixel < pixels && s.sample >= span.begin && s.sample < span.end && s.seeks <= kSeeksAlbedo;
  });
  if (!good) return damaged("it names samples that the pass does not have");
  return {};
}

Status SumsFile::finish() {
  uint64_t stored = 0;
  const uint64_t hash = hash_.value();
  SHOAL_RETURN_IF_ERROR(file_->read_at(at_, std::as_writable_bytes(std::span(&stored, 1))));
  if (stored != hash) return damaged(fmt::format("expected checksum {:016x}, found {:016x}", stored, hash));
  return {};
}

Result<uint64_t> unfinished_in(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, SumsFile::open(fs, path));
  return file->header().unfinished_count;
}

}  // namespace shoal
