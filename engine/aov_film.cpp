#include "engine/aov_film.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <type_traits>

namespace shoal {
namespace {

constexpr double kSmallUnit = 0x1p-40;
/// Rows that OpenEXR compresses at once, and the copies that it makes of them.
constexpr uint64_t kFileRows = 16, kFileCopies = 3;

int64_t small_sum(float value) {
  return static_cast<int64_t>(std::clamp(static_cast<double>(value), -1.0, 1.0) / kSmallUnit);
}

FixedPoint128 large_sum(float value) {
  return FixedPoint128::from_float(std::clamp(value, -Film::kMaxRadiance, Film::kMaxRadiance));
}

bool is_integer(Aov aov) { return aov == Aov::kSamples || aov == Aov::kObjectId || aov == Aov::kMaterialId; }

}  // namespace

static_assert(sizeof(SquareSum) == 24 && sizeof(FixedPoint128) == 16);  // aov_info() says what a pixel takes

Result<std::unique_ptr<AovFilm>> AovFilm::create(AovSet set, uint32_t width, uint32_t height, const PageFile& file) {
  ObjectIds objects;
  if (set.has(Aov::kObjectId)) {
    SHOAL_ASSIGN_OR_RETURN(objects, ObjectIds::read(file));
  }
  return std::make_unique<AovFilm>(set, width, height, std::move(objects),
                                   set.has(Aov::kBytes) ? file.page_count() : 0);
}

AovFilm::AovFilm(AovSet set, uint32_t width, uint32_t height, ObjectIds objects, size_t page_count)
    : set_(set), read_ahead_(page_count), objects_(std::move(objects)), locks_(std::make_unique<SpinLock[]>(kLocks)) {
  const size_t pixels = size_t{width} * height;
  if (set.has(Aov::kAlbedo)) albedo_.resize(3 * pixels);
  if (set.has(Aov::kNormal)) normal_.resize(3 * pixels);
  if (set.has(Aov::kDepth)) depth_.resize(pixels);
  if (set.has(Aov::kPosition)) position_.resize(3 * pixels);
  if (set.has(Aov::kVariance)) squares_.resize(3 * pixels);
  if (set.has(Aov::kObjectId)) object_ids_.resize(pixels);
  if (set.has(Aov::kMaterialId)) material_ids_.resize(pixels);
  if (set.has(Aov::kTreelets)) treelets_.resize(pixels);
  if (set.has(Aov::kBytes)) bytes_.resize(pixels);
}

uint64_t AovFilm::bytes(AovSet set, uint32_t width, uint32_t height, const PageFile& scene) {
  if (set.empty()) return 0;
  const uint64_t pixels = uint64_t{width} * height;
  uint64_t sums = 0, channels = 0;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    if (!set.has(Aov(i))) continue;
    sums += aov_info(Aov(i)).sum_bytes;
    channels += aov_info(Aov(i)).channels.size();
  }
  // The sums are gone before the layers are copied to be written; with those of the film there is room for the copies.
  const uint64_t file = channels * sizeof(float) * width * kFileRows * kFileCopies;
  const uint64_t objects = set.has(Aov::kObjectId) ? ObjectIds::bytes(scene) : 0;
  const uint64_t pages = set.has(Aov::kBytes) ? scene.page_count() * sizeof(uint32_t) : 0;
  return pixels * (sums + channels * sizeof(float)) + kLocks * sizeof(SpinLock) + file + objects + pages;
}

std::vector<AovFilm::Plane> AovFilm::planes() {
  std::vector<Plane> planes;
  const auto add = [&](Aov aov, auto& sums) {
    if (set_.has(aov)) planes.push_back({aov, std::as_writable_bytes(std::span(sums))});
  };
  add(Aov::kAlbedo, albedo_);
  add(Aov::kNormal, normal_);
  add(Aov::kDepth, depth_);
  add(Aov::kPosition, position_);
  add(Aov::kVariance, squares_);
  add(Aov::kObjectId, object_ids_);
  add(Aov::kMaterialId, material_ids_);
  add(Aov::kTreelets, treelets_);
  add(Aov::kBytes, bytes_);
  return planes;
}

bool AovFilm::plausible() const {
  const auto in_range = [](const FixedPoint128& sum) { return sum.in_range(); };
  return std::all_of(depth_.begin(), depth_.end(), in_range) && std::all_of(position_.begin(), position_.end(), in_range);
}

uint64_t AovFilm::plane_bytes(AovSet set, uint32_t width, uint32_t height) {
  uint64_t bytes = 0;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    if (set.has(Aov(i))) bytes += uint64_t{width} * height * aov_info(Aov(i)).sum_bytes;
  }
  return bytes;
}

void AovFilm::add_plane(Aov aov, uint64_t first_byte, std::span<const std::byte> bytes) {
  const auto each = [&]<class T>(std::vector<T>& sums, const auto& add) {
    SHOAL_CHECK(first_byte % sizeof(T) == 0 && bytes.size() % sizeof(T) == 0);
    T* to = sums.data() + first_byte / sizeof(T);
    for (size_t at = 0; at < bytes.size(); at += sizeof(T), ++to) {
      T from;
      std::memcpy(&from, &bytes[at], sizeof(T));
      add(*to, from);
    }
  };
  // Unsigned: what a part holds may be anything, and then the sum is something.
  const auto number = []<class T>(T& to, T from) {
    using Bits = std::make_unsigned_t<T>;
    to = static_cast<T>(static_cast<Bits>(to) + static_cast<Bits>(from));
  };
  const auto wide = [](auto& to, const auto& from) { to.add(from); };
  switch (aov) {
    case Aov::kAlbedo: return each(albedo_, number);
    case Aov::kNormal: return each(normal_, number);
    case Aov::kDepth: return each(depth_, wide);
    case Aov::kPosition: return each(position_, wide);
    case Aov::kVariance: return each(squares_, wide);
    case Aov::kObjectId: return each(object_ids_, number);  // of sample 0: one part has them, the others 0
    case Aov::kMaterialId: return each(material_ids_, number);
    case Aov::kTreelets: return each(treelets_, number);
    case Aov::kBytes: return each(bytes_, number);
    case Aov::kSamples: return;
  }
}

void AovFilm::add_first_hit(uint32_t pixel, const SurfaceFeatures& features) {
  std::lock_guard guard(locks_[pixel % kLocks]);
  for (size_t c = 0; c < 3; ++c) {
    if (!normal_.empty()) normal_[size_t{3} * pixel + c] += small_sum(features.normal[static_cast<int>(c)]);
    if (!position_.empty()) position_[size_t{3} * pixel + c].add(large_sum(features.position[static_cast<int>(c)]));
  }
  if (!depth_.empty()) depth_[pixel].add(large_sum(features.distance));
}

void AovFilm::add_albedo(uint32_t pixel, const Vec3& albedo) {
  if (albedo_.empty()) return;
  std::lock_guard guard(locks_[pixel % kLocks]);
  for (size_t c = 0; c < 3; ++c) albedo_[size_t{3} * pixel + c] += small_sum(albedo[static_cast<int>(c)]);
}

void AovFilm::set_ids(uint32_t pixel, const Hit& hit, uint32_t material) {
  if (!object_ids_.empty()) object_ids_[pixel] = objects_.of(hit);
  if (!material_ids_.empty()) material_ids_[pixel] = material + 1;
}

void AovFilm::add_radiance(uint32_t pixel, const Vec3& radiance) {
  if (squares_.empty()) return;
  std::lock_guard guard(locks_[pixel % kLocks]);
  for (size_t c = 0; c < 3; ++c) {
    squares_[size_t{3} * pixel + c].add_square(
        std::clamp(radiance[static_cast<int>(c)], -Film::kMaxRadiance, Film::kMaxRadiance));
  }
}

float AovFilm::value(Aov aov, const Film& film, size_t pixel, int channel) const {
  const size_t at = 3 * pixel + static_cast<size_t>(channel);
  const uint32_t added = film.added(pixel), covered = film.covered(pixel);
  const auto mean = [&](const std::vector<SmallSum>& sums) {
    return added == 0 ? 0.0f : static_cast<float>(static_cast<double>(sums[at]) * kSmallUnit / added);
  };
  switch (aov) {
    case Aov::kAlbedo: return mean(albedo_);
    case Aov::kNormal: return mean(normal_);
    case Aov::kDepth:
      return covered == 0 ? std::numeric_limits<float>::infinity()
                          : static_cast<float>(depth_[pixel].to_double() / covered);
    case Aov::kPosition: return covered == 0 ? 0.0f : static_cast<float>(position_[at].to_double() / covered);
    case Aov::kVariance: return static_cast<float>(sample_variance(film.sum(pixel, channel), squares_[at], added));
    case Aov::kTreelets: return static_cast<float>(treelets_[pixel]);
    case Aov::kBytes: return static_cast<float>(bytes_[pixel]);
    default: return 0;
  }
}

uint32_t AovFilm::integer(Aov aov, const Film& film, size_t pixel) const {
  if (aov == Aov::kSamples) return film.added(pixel);
  return aov == Aov::kObjectId ? object_ids_[pixel] : material_ids_[pixel];
}

std::vector<ExrChannel> AovFilm::resolve(const Film& film) const {
  const size_t pixels = size_t{film.width()} * film.height();
  std::vector<ExrChannel> layers;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    const Aov aov = Aov(i);
    if (!set_.has(aov)) continue;
    const AovInfo& info = aov_info(aov);
    for (size_t c = 0; c < info.channels.size(); ++c) {
      ExrChannel& layer = layers.emplace_back();
      layer.name = std::string(info.name) + '.' + info.channels[c];
      if (is_integer(aov)) {
        layer.integers.resize(pixels);
        for (size_t p = 0; p < pixels; ++p) layer.integers[p] = integer(aov, film, p);
      } else {
        layer.values.resize(pixels);
        for (size_t p = 0; p < pixels; ++p) layer.values[p] = value(aov, film, p, static_cast<int>(c));
      }
    }
  }
  return layers;
}

}  // namespace shoal
