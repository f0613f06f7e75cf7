#include "treelets/crop_coverage.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

namespace shoal {
namespace {

// Texel coordinates beyond this are clamped: their neighbours are no longer apart in float, and no int32 overflows.
constexpr double kMaxTexelCoordinate = 0x1p22;

// Traversal interpolates uv in float: three products and two sums of values up to the largest corner, each rounded
// once, move the result by less than 4 units of 2^-24 relative to it; 2^-20 leaves room for another order of sums.
constexpr double kInterpolationSlack = 0x1p-20;

bool all_finite(const float* values, int count) {
  return std::all_of(values, values + count, [](float v) { return std::isfinite(v); });
}

// One axis of a triangle's texel footprint at some level.
struct Footprint {
  float uv[3];    // in texels, moved by whole periods next to zero
  int32_t begin;  // first texel
  uint64_t size;  // texels
};

Footprint measure(const double uv[3], uint32_t level_texels, WrapMode wrap) {
  double texels[3], lowest = HUGE_VAL;
  for (int c = 0; c < 3; ++c) {
    texels[c] = std::clamp(uv[c] * level_texels, -kMaxTexelCoordinate, kMaxTexelCoordinate);
    lowest = std::min(lowest, texels[c]);
  }
  // Whole periods make no difference; without them equal tiles share their crop and floats are finer.
  const double period = wrap == WrapMode::kMirroredRepeat ? 2.0 * level_texels : level_texels;
  const double shift = wrap == WrapMode::kClampToEdge ? 0 : std::floor(lowest / period) * period;
  Footprint f;
  double lo = HUGE_VAL, hi = -HUGE_VAL, largest = 0;
  for (int c = 0; c < 3; ++c) {
    f.uv[c] = static_cast<float>(texels[c] - shift);
    lo = std::min<double>(lo, f.uv[c]), hi = std::max<double>(hi, f.uv[c]);
    largest = std::max<double>(largest, std::fabs(f.uv[c]));
  }
  // Bilinear interpolation at u reads texels floor(u - 0.5) and the next.
  const double slack = largest * kInterpolationSlack;
  const double begin = std::floor(lo - 0.5 - slack), last = std::floor(hi - 0.5 + slack) + 1;
  f.begin = static_cast<int32_t>(begin);
  f.size = static_cast<uint64_t>(last - begin) + 1;
  return f;
}

uint32_t wrap_texel(int64_t i, uint32_t size, WrapMode wrap) {
  const int64_t n = size;
  if (wrap == WrapMode::kClampToEdge) return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, n - 1));
  const int64_t period = wrap == WrapMode::kMirroredRepeat ? 2 * n : n;
  i = ((i % period) + period) % period;
  return static_cast<uint32_t>(i < n ? i : period - 1 - i);
}

// Opaque whatever the ray: no texture, and an alpha that is the same everywhere and enough.
bool always_there(const CoverageRecord& r) {
  if (r.crop_width != 0 || r.vertex_alpha[0] != r.vertex_alpha[1] || r.vertex_alpha[0] != r.vertex_alpha[2]) {
    return false;
  }
  const float enough = r.mode == static_cast<uint8_t>(CoverageMode::kMask) ? r.cutoff : 1.0f;
  return r.factor * r.vertex_alpha[0] >= enough;
}

}  // namespace

CoverageCropper::CoverageCropper(const TriangleSoup& soup, const CoverageSource* source)
    : soup_(soup), source_(source) {
  if (source == nullptr) return;
  std::unordered_set<uint32_t> seen;
  uint32_t last = kNoIndex;
  for (const uint32_t material : soup.material) {
    if (material == last || !seen.insert(last = material).second) continue;
    const MaterialCoverage coverage = source->coverage(material);
    if (coverage.mode != CoverageMode::kOpaque) materials_.emplace(material, coverage);
  }
}

std::optional<CoveragePlan> CoverageCropper::plan(uint32_t triangle) const {
  if (materials_.empty()) return std::nullopt;
  const auto found = materials_.find(soup_.material[triangle]);
  if (found == materials_.end()) return std::nullopt;
  const MaterialCoverage& material = found->second;
  const CornerLayout& layout = soup_.layout;
  const float* corner = soup_.corners.data() + size_t{3} * layout.floats() * triangle;

  CoveragePlan plan;
  CoverageRecord& record = plan.record;
  record.mode = static_cast<uint8_t>(material.mode);
  record.factor = material.factor;
  record.cutoff = material.cutoff;
  double u[3] = {}, v[3] = {};
  for (uint32_t c = 0; c < 3; ++c, corner += layout.floats()) {
    // What is missing or not finite has the default that treelets/pack_attributes gives it.
    record.vertex_alpha[c] = 1;
    if (layout.color && all_finite(corner + layout.color_offset(), 4)) {
      record.vertex_alpha[c] = corner[layout.color_offset() + 3];
    }
    if (material.uv_set >= layout.uv_count) continue;
    const float* uv = corner + layout.uv_offset(material.uv_set);
    if (!all_finite(uv, 2)) continue;
    u[c] = uv[0], v[c] = uv[1];
    if (!material.transformed) continue;
    const float* m = material.uv_transform;
    u[c] = double{m[0]} * uv[0] + double{m[1]} * uv[1] + m[2];
    v[c] = double{m[3]} * uv[0] + double{m[4]} * uv[1] + m[5];
  }
  if (material.texture == kNoIndex) return always_there(record) ? std::nullopt : std::optional(plan);

  record.wrap_u = static_cast<uint8_t>(material.wrap_u);
  record.wrap_v = static_cast<uint8_t>(material.wrap_v);
  record.nearest = material.nearest ? 1 : 0;
  const uint32_t level_count = source_->level_count(material.texture);
  for (uint32_t level = 0; level < level_count; ++level) {
    uint32_t width = 0, height = 0;
    source_->level_size(material.texture, level, &width, &height);
    const Footprint x = measure(u, width, material.wrap_u), y = measure(v, height, material.wrap_v);
    const bool crop_fits = x.size <= kMaxCropTexels && y.size <= kMaxCropTexels;
    const bool level_fits = width <= kMaxCropTexels && height <= kMaxCropTexels;
    if (!crop_fits && !level_fits) continue;
    // Both hold the same texels: take the smaller one.
    const bool whole = !crop_fits || (level_fits && uint64_t{width} * height < x.size * y.size);
    for (int c = 0; c < 3; ++c) record.uv[2 * c] = x.uv[c], record.uv[2 * c + 1] = y.uv[c];
    record.whole_level = whole ? 1 : 0;
    record.crop_x = whole ? 0 : x.begin, record.crop_y = whole ? 0 : y.begin;
    record.crop_width = whole ? width : static_cast<uint32_t>(x.size);
    record.crop_height = whole ? height : static_cast<uint32_t>(y.size);
    plan.crop = {material.texture,   level,           record.crop_x,  record.crop_y, record.crop_width,
                 record.crop_height, material.wrap_u, material.wrap_v};
    break;  // pyramids end at one texel: some level fits
  }
  return plan;
}

Status CoverageCropper::read_crop(const CropKey& crop, std::span<uint8_t> out) const {
  SHOAL_CHECK(out.size() == crop.texel_bytes());
  uint32_t width = 0, height = 0;
  source_->level_size(crop.texture, crop.level, &width, &height);
  std::vector<uint8_t> row(width);
  for (uint32_t y = 0; y < crop.height; ++y) {
    const uint32_t source_y = wrap_texel(int64_t{crop.y} + y, height, crop.wrap_v);
    SHOAL_RETURN_IF_ERROR(source_->read_alpha(crop.texture, crop.level, 0, source_y, row));
    for (uint32_t x = 0; x < crop.width; ++x) {
      out[size_t{y} * crop.width + x] = row[wrap_texel(int64_t{crop.x} + x, width, crop.wrap_u)];
    }
  }
  return {};
}

size_t CropSet::Hash::operator()(const CropKey& key) const {
  uint64_t h = 0;
  const auto mix = [&h](uint64_t v) { h = (h ^ v) * 0x9e3779b97f4a7c15ull, h ^= h >> 29; };
  mix(uint64_t{key.texture} << 32 | key.level);
  mix(uint64_t{static_cast<uint32_t>(key.x)} << 32 | static_cast<uint32_t>(key.y));
  mix(uint64_t{key.width} << 32 | key.height);
  return h;
}

uint32_t CropSet::add(const CropKey& key) {
  const auto [place, added] = offsets_.try_emplace(key, static_cast<uint32_t>(texel_bytes_));
  if (added) {
    keys_.push_back(key);
    texel_bytes_ += key.texel_bytes();
  }
  return place->second;
}

void CropSet::truncate(size_t count) {
  for (; keys_.size() > count; keys_.pop_back()) {
    texel_bytes_ -= keys_.back().texel_bytes();
    offsets_.erase(keys_.back());
  }
}

}  // namespace shoal
