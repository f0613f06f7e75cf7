#include "io/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include "tests/io/image_samples.h"
#include "tests/support/memory_file_system.h"

namespace shoal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr uint64_t kPixels = 1 << 20;

std::vector<uint8_t> pattern(size_t n) {
  std::vector<uint8_t> bytes(n);
  for (size_t i = 0; i < n; ++i) bytes[i] = static_cast<uint8_t>(i * 37 + i / 7);
  return bytes;
}

Image8 decode(const std::vector<std::byte>& bytes) {
  auto image = decode_image(bytes, "test", kPixels);
  if (image.ok()) return std::move(image).value();
  ADD_FAILURE() << image.error().message;
  return {};
}

/// The RGBA of pixel i of 8-bit samples, as the PNG specification defines the colour types.
std::array<uint8_t, 4> expected_rgba(int color_type, const std::vector<uint8_t>& samples, size_t i) {
  switch (color_type) {
    case PNG_COLOR_TYPE_GRAY:
      return {samples[i], samples[i], samples[i], 255};
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      return {samples[2 * i], samples[2 * i], samples[2 * i], samples[2 * i + 1]};
    case PNG_COLOR_TYPE_RGB:
      return {samples[3 * i], samples[3 * i + 1], samples[3 * i + 2], 255};
    default:
      return {samples[4 * i], samples[4 * i + 1], samples[4 * i + 2], samples[4 * i + 3]};
  }
}

TEST(DecodeImage, ReadsEveryColourTypeOfPngAt8And16BitsInterlacedOrNot) {
  constexpr uint32_t kWidth = 13, kHeight = 11;
  const std::pair<int, size_t> kinds[] = {{PNG_COLOR_TYPE_GRAY, 1},
                                          {PNG_COLOR_TYPE_GRAY_ALPHA, 2},
                                          {PNG_COLOR_TYPE_RGB, 3},
                                          {PNG_COLOR_TYPE_RGB_ALPHA, 4}};
  for (const auto& [type, samples_per_pixel] : kinds) {
    for (const int bits : {8, 16}) {
      for (const bool interlaced : {false, true}) {
        const auto high = pattern(kWidth * kHeight * samples_per_pixel);
        std::vector<uint8_t> bytes;
        for (const uint8_t sample : high) {
          bytes.push_back(sample);
          if (bits == 16) bytes.push_back(0xff);  // the low byte is dropped, not rounded
        }
        const Image8 image = decode(make_png(kWidth, kHeight, type, bits, interlaced, bytes));
        ASSERT_EQ(image.width, kWidth);
        ASSERT_EQ(image.height, kHeight);
        EXPECT_EQ(image.has_alpha, samples_per_pixel % 2 == 0);
        for (size_t i = 0; i < kWidth * kHeight; ++i) {
          const auto rgba = expected_rgba(type, high, i);
          ASSERT_TRUE(std::equal(rgba.begin(), rgba.end(), image.rgba.begin() + static_cast<ptrdiff_t>(4 * i)))
              << "type " << type << " bits " << bits << " pixel " << i;
        }
      }
    }
  }
}

TEST(DecodeImage, ExpandsPalettesSmallDepthsAndTransparency) {
  const std::vector<uint8_t> palette{10, 20, 30, 40, 50, 60, 70, 80, 90};
  const Image8 colors = decode(make_png(3, 1, PNG_COLOR_TYPE_PALETTE, 2, false, {0b00011000}, palette, {9, 8}));
  EXPECT_THAT(colors.rgba, ElementsAre(10, 20, 30, 9, 40, 50, 60, 8, 70, 80, 90, 255));
  EXPECT_TRUE(colors.has_alpha);
  const Image8 bits = decode(make_png(3, 1, PNG_COLOR_TYPE_GRAY, 1, false, {0b10100000}));
  EXPECT_THAT(bits.rgba, ElementsAre(255, 255, 255, 255, 0, 0, 0, 255, 255, 255, 255, 255));
  const Image8 keyed = decode(make_png(2, 1, PNG_COLOR_TYPE_RGB, 8, false, {0, 0, 0, 1, 2, 3}, {}, {1}));
  EXPECT_THAT(keyed.rgba, ElementsAre(0, 0, 0, 0, 1, 2, 3, 255));
}

TEST(DecodeImage, ReadsGreyAndColourJpegsWithinTheirLoss) {
  constexpr uint32_t kSide = 32;
  for (const int components : {1, 3}) {
    for (const bool progressive : {false, true}) {
      std::vector<uint8_t> pixels;
      for (uint32_t i = 0; i < kSide * kSide; ++i) {
        for (int c = 0; c < components; ++c) pixels.push_back(static_cast<uint8_t>(i % kSide * 4 + 40 * c));
      }
      const Image8 image = decode(make_jpeg(kSide, kSide, components, progressive, pixels));
      ASSERT_EQ(image.rgba.size(), 4 * kSide * kSide);
      EXPECT_FALSE(image.has_alpha);
      for (size_t i = 0; i < kSide * kSide; ++i) {
        const size_t n = static_cast<size_t>(components);
        for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(image.rgba[4 * i + c], pixels[n * i + (n == 1 ? 0 : c)], 8);
        ASSERT_EQ(image.rgba[4 * i + 3], 255);
      }
    }
  }
}

TEST(DecodeImage, RefusesCmykJpegsOtherFormatsAndTooManyPixels) {
  const auto cmyk = decode_image(make_jpeg(8, 8, 4, false, pattern(256)), "ink.jpg", kPixels);
  ASSERT_FALSE(cmyk.ok());
  EXPECT_THAT(cmyk.error().message, HasSubstr("CMYK"));
  const auto webp = decode_image(std::as_bytes(std::span("RIFF....WEBP")), "a.webp", kPixels);
  ASSERT_FALSE(webp.ok());
  EXPECT_EQ(webp.error().code, ErrorCode::kInput);
  const auto png = decode_image(make_png(4, 4, PNG_COLOR_TYPE_GRAY, 8, false, pattern(16)), "a.png", 15);
  ASSERT_FALSE(png.ok());
  EXPECT_EQ(png.error().message, "a.png: expected at most 15 pixels, found 4 x 4");
  const auto jpeg = decode_image(make_jpeg(4, 4, 1, false, pattern(16)), "a.jpg", 15);
  ASSERT_FALSE(jpeg.ok());
  EXPECT_EQ(jpeg.error().message, "a.jpg: expected at most 15 pixels, found 4 x 4");
}

TEST(DecodeImage, ReadsWebpWithAlphaAndWithout) {
  std::vector<uint8_t> rgba;
  for (uint32_t i = 0; i < 32 * 32; ++i) {
    for (const uint32_t v : {i % 32 * 8, i / 32 * 8, 90u, 255u}) rgba.push_back(static_cast<uint8_t>(v));
  }
  const auto opaque = decode_image(make_webp(32, 32, true, rgba), "a.webp", kPixels);
  ASSERT_TRUE(opaque.ok()) << opaque.error().message;
  EXPECT_EQ(opaque.value().rgba, rgba);
  EXPECT_FALSE(opaque.value().has_alpha);
  const auto lossy = decode_image(make_webp(32, 32, false, rgba), "a.webp", kPixels);
  ASSERT_TRUE(lossy.ok()) << lossy.error().message;
  for (size_t i = 0; i < rgba.size(); ++i) ASSERT_NEAR(lossy.value().rgba[i], rgba[i], 24) << i;
  for (size_t i = 3; i < rgba.size(); i += 4) rgba[i] = static_cast<uint8_t>(i);
  const auto clear = decode_image(make_webp(32, 32, true, rgba), "a.webp", kPixels);
  ASSERT_TRUE(clear.ok());
  EXPECT_TRUE(clear.value().has_alpha);
  for (size_t i = 3; i < rgba.size(); i += 4) ASSERT_EQ(clear.value().rgba[i], rgba[i]);
  const auto large = decode_image(make_webp(32, 32, true, rgba), "a.webp", 1023);
  ASSERT_FALSE(large.ok());
  EXPECT_EQ(large.error().message, "a.webp: expected at most 1023 pixels, found 32 x 32");
}

TEST(DecodeImage, RefusesPicturesCutOffAnywhere) {
  const std::vector<std::byte> pictures[] = {make_png(9, 9, PNG_COLOR_TYPE_RGB, 8, true, pattern(243)),
                                             make_jpeg(24, 24, 3, false, pattern(1728)),
                                             make_jpeg(24, 24, 3, true, pattern(1728)),
                                             make_webp(24, 24, true, pattern(2304)),
                                             make_webp(24, 24, false, pattern(2304))};
  for (const auto& bytes : pictures) {
    for (size_t size = 0; size + 2 < bytes.size(); ++size) {
      const auto image = decode_image(std::span(bytes).first(size), "cut", kPixels);
      ASSERT_FALSE(image.ok()) << size << " of " << bytes.size();
      ASSERT_EQ(image.error().code, ErrorCode::kInput);
    }
  }
}

TEST(WritePng, WritesWhatDecodeImageReads) {
  MemoryFileSystem fs;
  const auto rgb = pattern(5 * 3 * 3);
  ASSERT_TRUE(write_png(fs, "out.png", 5, 3, rgb).ok());
  EXPECT_THAT(fs.names(), ElementsAre("out.png"));
  const Image8 image = decode(fs.contents("out.png"));
  ASSERT_EQ(image.width, 5u);
  ASSERT_EQ(image.height, 3u);
  for (size_t i = 0; i < 15; ++i) {
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(image.rgba[4 * i + c], rgb[3 * i + c]);
  }
}

}  // namespace
}  // namespace shoal
