#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>

#include "tests/support/sample_soups.h"
#include "tests/support/treelet_reader.h"
#include "treelets/build_object.h"

namespace shoal {
namespace {

using testing::add_triangle;
using testing::MemorySink;
using testing::Numbers;
using testing::ReadTriangle;

// Texture t of size `width[t]` x `height[t]` with alpha as a hash of its place; material m has `materials[m]`.
class HashedAlpha : public CoverageSource {
 public:
  struct Size {
    uint32_t width, height;
  };
  std::map<uint32_t, MaterialCoverage> materials;
  std::vector<Size> textures;
  uint32_t failing_texture = kNoIndex;

  MaterialCoverage coverage(uint32_t material) const override {
    const auto it = materials.find(material);
    return it == materials.end() ? MaterialCoverage{} : it->second;
  }
  uint32_t level_count(uint32_t texture) const override {
    uint32_t count = 1;
    for (uint32_t n = std::max(textures[texture].width, textures[texture].height); n > 1; n >>= 1) ++count;
    return count;
  }
  void level_size(uint32_t texture, uint32_t level, uint32_t* width, uint32_t* height) const override {
    *width = std::max(1u, textures[texture].width >> level);
    *height = std::max(1u, textures[texture].height >> level);
  }
  static uint8_t alpha(uint32_t texture, uint32_t level, uint32_t x, uint32_t y) {
    return static_cast<uint8_t>(
        Numbers(uint64_t{x} << 40 ^ uint64_t{y} << 16 ^ uint64_t{texture} << 8 ^ level).next());
  }
  Status read_alpha(uint32_t texture, uint32_t level, uint32_t x, uint32_t y,
                    std::span<uint8_t> out) const override {
    uint32_t width = 0, height = 0;
    level_size(texture, level, &width, &height);
    if (x + out.size() > width || y >= height) return Error{ErrorCode::kInternal, "a read outside the level"};
    if (texture == failing_texture) return Error{ErrorCode::kInput, "a texture that cannot be read"};
    for (size_t i = 0; i < out.size(); ++i) out[i] = alpha(texture, level, x + static_cast<uint32_t>(i), y);
    return {};
  }
};

int64_t reference_wrap(int64_t i, int64_t n, WrapMode mode) {
  if (mode == WrapMode::kClampToEdge) return i < 0 ? 0 : i >= n ? n - 1 : i;
  if (mode == WrapMode::kRepeat) {
    while (i < 0) i += n;
    while (i >= n) i -= n;
    return i;
  }
  while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
  return i;
}

// Random triangles with uv triangles of about `extent` around +-`offset`.
TriangleSoup covered_soup(uint32_t count, float extent, float offset, uint32_t materials) {
  TriangleSoup soup = testing::random_soup(count, 0.02f);
  soup.layout.uv_count = 2;
  soup.layout.color = true;
  Numbers numbers(5);
  for (uint32_t i = 0; i < count; ++i) {
    soup.material[i] = numbers.below(materials);
    const float u = numbers.uniform(-offset, offset), v = numbers.uniform(-offset, offset);
    for (int c = 0; c < 3; ++c) {
      for (const float value : {1.0f, 1.0f, 1.0f, numbers.uniform(0, 1), 9.0f, 9.0f}) soup.corners.push_back(value);
      soup.corners.push_back(u + extent * numbers.uniform(-1, 1));
      soup.corners.push_back(v + extent * numbers.uniform(-1, 1));
    }
  }
  return soup;
}

MaterialCoverage textured(uint32_t texture, WrapMode wrap_u, WrapMode wrap_v) {
  MaterialCoverage m;
  m.mode = CoverageMode::kMask;
  m.texture = texture;
  m.uv_set = 1;
  m.wrap_u = wrap_u, m.wrap_v = wrap_v;
  return m;
}

// The source uv of a corner.
struct Sampled {
  double u, v;
};

// Every texel that bilinear interpolation could read at the corners and at the centre is in the crop, and is the
// texel of the source. Returns the level.
uint32_t expect_texels(const ReadTriangle& t, const MaterialCoverage& m, const HashedAlpha& source,
                       const std::vector<Sampled>& corners) {
  const CoverageRecord& r = *t.coverage;
  EXPECT_GT(r.crop_width, 0u);
  EXPECT_LE(r.crop_width, kMaxCropTexels);
  EXPECT_LE(r.crop_height, kMaxCropTexels);
  for (uint32_t level = 0; level < source.level_count(m.texture); ++level) {
    uint32_t w = 0, h = 0;
    source.level_size(m.texture, level, &w, &h);
    // Whole periods may have been taken off; the differences between corners tell the level.
    const double du = (corners[1].u - corners[0].u) * w, dv = (corners[1].v - corners[0].v) * h;
    if (std::abs(du - (r.uv[2] - r.uv[0])) > 1e-2 || std::abs(dv - (r.uv[3] - r.uv[1])) > 1e-2) continue;
    const auto texel = [&](int64_t x, int64_t y) -> int {
      const int64_t cx = r.whole_level ? reference_wrap(x, r.crop_width, m.wrap_u) : x - r.crop_x;
      const int64_t cy = r.whole_level ? reference_wrap(y, r.crop_height, m.wrap_v) : y - r.crop_y;
      if (cx < 0 || cy < 0 || cx >= r.crop_width || cy >= r.crop_height) return -1;
      return t.texels[static_cast<size_t>(cy * r.crop_width + cx)];
    };
    bool all_equal = true;
    for (int k = 0; k < 4; ++k) {  // three corners and the centre
      const double u = k < 3 ? corners[k].u * w : (corners[0].u + corners[1].u + corners[2].u) / 3 * w;
      const double v = k < 3 ? corners[k].v * h : (corners[0].v + corners[1].v + corners[2].v) / 3 * h;
      const double crop_u = k < 3 ? r.uv[2 * k] : (r.uv[0] + r.uv[2] + r.uv[4]) / 3;
      const double crop_v = k < 3 ? r.uv[2 * k + 1] : (r.uv[1] + r.uv[3] + r.uv[5]) / 3;
      const auto shift_x = static_cast<int64_t>(std::llround(u - crop_u)),
                 shift_y = static_cast<int64_t>(std::llround(v - crop_v));
      const auto x = static_cast<int64_t>(std::floor(crop_u - 0.5)),
                 y = static_cast<int64_t>(std::floor(crop_v - 0.5));
      for (int i = 0; i < 4; ++i) {
        const int64_t tx = x + i % 2, ty = y + i / 2;
        const auto sx = static_cast<uint32_t>(reference_wrap(tx + shift_x, w, m.wrap_u));
        const auto sy = static_cast<uint32_t>(reference_wrap(ty + shift_y, h, m.wrap_v));
        all_equal &= texel(tx, ty) == HashedAlpha::alpha(m.texture, level, sx, sy);
      }
    }
    if (all_equal) return level;
  }
  ADD_FAILURE() << "no level has the texels of primitive " << t.primitive;
  return kNoIndex;
}

TEST(BuildCoverage, CropsHoldTheTexelsOfTheSource) {
  HashedAlpha source;
  source.textures = std::vector<HashedAlpha::Size>{{64, 32}, {2048, 1024}, {300, 7}, {4, 4}};
  const WrapMode modes[] = {WrapMode::kRepeat, WrapMode::kMirroredRepeat, WrapMode::kClampToEdge};
  for (uint32_t m = 0; m < 12; ++m) source.materials[m] = textured(m / 3, modes[m % 3], modes[(m / 3 + m) % 3]);
  for (const float extent : {0.01f, 0.3f, 3.0f}) {
    const TriangleSoup soup = covered_soup(600, extent, 4.0f, 12);
    MemorySink sink;
    const Result<BuiltObject> object = build_object(TriangleSoup(soup), {64u << 10}, &source, sink);
    ASSERT_TRUE(object.ok());
    uint64_t found = 0;
    read_object(object.value(), sink.treelets, [&](const ReadTriangle& t) {
      ++found;
      ASSERT_TRUE(t.coverage.has_value());
      const MaterialCoverage& m = source.materials[t.material];
      std::vector<Sampled> corners;
      for (int c = 0; c < 3; ++c) {
        corners.push_back({t.corner[c][13], t.corner[c][14]});
        EXPECT_EQ(t.coverage->vertex_alpha[c], t.corner[c][10]);
      }
      const uint32_t level = expect_texels(t, m, source, corners);
      if (extent < 0.02f && m.texture == 0) {
        EXPECT_EQ(level, 0u);
      }  // small enough for the finest level
    });
    EXPECT_EQ(found, soup.size());
  }
}

TEST(BuildCoverage, TheCropOfATriangleDoesNotDependOnTheTreelet) {
  HashedAlpha source;
  source.textures = std::vector<HashedAlpha::Size>{{512, 512}};
  source.materials[0] = textured(0, WrapMode::kRepeat, WrapMode::kRepeat);
  const TriangleSoup soup = covered_soup(2000, 0.05f, 2.0f, 2);
  std::map<uint32_t, ReadTriangle> first;
  for (const uint32_t size : {4u << 10, 4u << 20}) {
    MemorySink sink;
    const Result<BuiltObject> object = build_object(TriangleSoup(soup), {size}, &source, sink);
    ASSERT_TRUE(object.ok());
    read_object(object.value(), sink.treelets, [&](const ReadTriangle& t) {
      const auto [it, added] = first.emplace(t.primitive, t);
      EXPECT_EQ(t.coverage.has_value(), t.material == 0);
      if (added || !t.coverage) return;
      CoverageRecord a = *t.coverage, b = *it->second.coverage;
      a.texel_offset = b.texel_offset = 0;
      EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
      EXPECT_EQ(t.texels, it->second.texels);
    });
  }
}

TEST(BuildCoverage, EqualCropsAreStoredOnceAndCountedWhenCutting) {
  // Many cards, each two triangles over the same whole uv square.
  TriangleSoup soup;
  soup.layout.uv_count = 1;
  Numbers numbers(3);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p(numbers.uniform(0, 1), numbers.uniform(0, 1), numbers.uniform(0, 1));
    add_triangle(soup, p, p + Vec3(.01f, 0, 0), p + Vec3(.01f, .01f, 0));
    add_triangle(soup, p, p + Vec3(.01f, .01f, 0), p + Vec3(0, .01f, 0));
    for (const int uv : {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1}) soup.corners.push_back(static_cast<float>(uv));
  }
  HashedAlpha source;
  source.textures = std::vector<HashedAlpha::Size>{{128, 128}};
  source.materials[0] = textured(0, WrapMode::kRepeat, WrapMode::kRepeat);
  source.materials[0].uv_set = 0;
  MemorySink sink;
  ASSERT_TRUE(build_object(std::move(soup), {64u << 10}, &source, sink).ok());
  for (const auto& treelet : sink.treelets) {
    EXPECT_LE(treelet.geometry.size(), 64u << 10);
    TreeletHeader header;
    std::memcpy(&header, treelet.geometry.data(), sizeof header);
    EXPECT_EQ(header.coverage_texel_bytes, 128u * 128u);  // the whole level is smaller than a crop with its border
  }
}

TEST(BuildCoverage, WithoutTextureAConstantAlphaIsDecidedAtOnce) {
  HashedAlpha source;
  const auto plain = [](CoverageMode mode, float factor) {
    MaterialCoverage m;
    m.mode = mode;
    m.factor = factor;
    return m;
  };
  source.materials = {{0, plain(CoverageMode::kMask, 0.5f)},   // at the cutoff: opaque
                      {1, plain(CoverageMode::kMask, 0.49f)},  // below it
                      {2, plain(CoverageMode::kBlend, 1.0f)},  // opaque
                      {3, plain(CoverageMode::kBlend, 0.99f)},
                      {4, MaterialCoverage{}}};
  TriangleSoup soup = testing::random_soup(500, 0.02f);
  for (uint32_t i = 0; i < soup.size(); ++i) soup.material[i] = i % 5;
  MemorySink sink;
  const Result<BuiltObject> object = build_object(std::move(soup), {64u << 10}, &source, sink);
  ASSERT_TRUE(object.ok());
  read_object(object.value(), sink.treelets, [&](const ReadTriangle& t) {
    EXPECT_EQ(t.coverage.has_value(), t.material == 1 || t.material == 3);
    if (!t.coverage) return;
    EXPECT_EQ(t.coverage->crop_width, 0u);
    EXPECT_EQ(t.coverage->factor, source.materials[t.material].factor);
    EXPECT_EQ(t.coverage->vertex_alpha[2], 1.0f);
  });
}

TEST(BuildCoverage, HostileTextureCoordinatesGiveBoundedCrops) {
  HashedAlpha source;
  source.textures = std::vector<HashedAlpha::Size>{{1024, 16}};
  for (uint32_t m = 0; m < 3; ++m) {
    source.materials[m] = textured(0, static_cast<WrapMode>(m), static_cast<WrapMode>(m));
    source.materials[m].uv_set = m == 2 ? 3 : 0;  // one names a set that is not there
  }
  TriangleSoup soup = testing::random_soup(60, 0.1f);
  soup.layout.uv_count = 1;
  const float values[] = {
      0,      1e30f, -1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(),
      1e-40f, -3};
  Numbers numbers(11);
  for (size_t i = 0; i < 6 * soup.size(); ++i) soup.corners.push_back(values[numbers.below(7)]);
  MemorySink sink;
  const Result<BuiltObject> object = build_object(std::move(soup), {4u << 10}, &source, sink);
  ASSERT_TRUE(object.ok());
  read_object(object.value(), sink.treelets, [](const ReadTriangle& t) {
    ASSERT_TRUE(t.coverage.has_value());
    EXPECT_LE(t.coverage->crop_width, kMaxCropTexels);
    EXPECT_LE(t.coverage->crop_height, kMaxCropTexels);
    for (const float uv : t.coverage->uv) EXPECT_LE(std::abs(uv), 0x1p23f);
  });
}

TEST(BuildCoverage, FailsWithTheErrorOfTheSource) {
  HashedAlpha source;
  source.textures = std::vector<HashedAlpha::Size>{{64, 64}};
  source.failing_texture = 0;
  source.materials[1] = textured(0, WrapMode::kRepeat, WrapMode::kRepeat);
  MemorySink sink;
  const Result<BuiltObject> object = build_object(covered_soup(500, 0.1f, 1, 3), {4u << 10}, &source, sink);
  ASSERT_FALSE(object.ok());
  EXPECT_EQ(object.error().code, ErrorCode::kInput);
}

}  // namespace
}  // namespace shoal
