// Thumbnails are means of what they stand for, and hostile files are refused.
#include "io/png_thumbnail.h"

#include <gtest/gtest.h>

#include "io/base64.h"
#include "io/image.h"
#include "tests/support/memory_file_system.h"

namespace shoal::testing {
namespace {

std::vector<uint8_t> ramp(uint32_t width, uint32_t height) {
  std::vector<uint8_t> rgb;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      rgb.insert(rgb.end(), {static_cast<uint8_t>(x * 7 % 256), static_cast<uint8_t>(y * 5 % 256), 200});
    }
  }
  return rgb;
}

TEST(PngThumbnail, SmallPicturesStayAsTheyAre) {
  MemoryFileSystem fs;
  const auto rgb = ramp(20, 9);
  ASSERT_TRUE(write_png(fs, "a.png", 20, 9, rgb).ok());
  const auto small = shrink_png(fs, "a.png", 20);
  ASSERT_TRUE(small.ok()) << small.error().message;
  EXPECT_EQ(small.value().width, 20u);
  EXPECT_EQ(small.value().height, 9u);
  EXPECT_EQ(small.value().rgb, rgb);
}

TEST(PngThumbnail, PixelsAreMeans) {
  MemoryFileSystem fs;
  const uint32_t width = 400, height = 200;
  const auto rgb = ramp(width, height);
  ASSERT_TRUE(write_png(fs, "a.png", width, height, rgb).ok());
  const auto small = shrink_png(fs, "a.png", 100);
  ASSERT_TRUE(small.ok()) << small.error().message;
  ASSERT_EQ(small.value().width, 100u);
  ASSERT_EQ(small.value().height, 50u);
  for (const uint32_t pixel : {0u, 99u, 1234u, 4999u}) {
    const uint32_t x = pixel % 100 * 4, y = pixel / 100 * 4;
    uint32_t sum = 0;
    for (uint32_t i = 0; i < 16; ++i) sum += rgb[((y + i / 4) * width + x + i % 4) * 3];
    EXPECT_EQ(small.value().rgb[pixel * 3], sum / 16) << pixel;
    EXPECT_EQ(small.value().rgb[pixel * 3 + 2], 200);
  }
}

TEST(PngThumbnail, ExtremeShapesHaveAtLeastAPixel) {
  MemoryFileSystem fs;
  ASSERT_TRUE(write_png(fs, "a.png", 3000, 1, ramp(3000, 1)).ok());
  const auto small = shrink_png(fs, "a.png", 10);
  ASSERT_TRUE(small.ok());
  EXPECT_EQ(small.value().width, 10u);
  EXPECT_EQ(small.value().height, 1u);
}

TEST(PngThumbnail, WhatIsNoPngIsRefused) {
  MemoryFileSystem fs;
  EXPECT_FALSE(shrink_png(fs, "missing.png", 10).ok());
  ASSERT_TRUE(write_png(fs, "a.png", 64, 64, ramp(64, 64)).ok());
  const std::vector<std::byte> whole = fs.contents("a.png");
  for (size_t bytes = 0; bytes < whole.size() - 12; bytes += 7) {
    ASSERT_TRUE(write_whole_file(fs, "cut.png", std::span(whole).first(bytes)).ok());
    const auto refused = shrink_png(fs, "cut.png", 10);
    if (!refused.ok()) {
      EXPECT_EQ(refused.error().code, ErrorCode::kInput);
      continue;
    }
    EXPECT_GT(bytes, whole.size() / 2) << "every row was there";
  }
}

TEST(Base64, WhatIsEncodedDecodes) {
  std::vector<std::byte> bytes;
  for (int n = 0; n < 70; ++n) {
    const std::string text = encode_base64(bytes);
    EXPECT_EQ(text.size(), (bytes.size() + 2) / 3 * 4);
    const auto decoded = decode_base64(text);
    ASSERT_TRUE(decoded.has_value()) << text;
    EXPECT_EQ(*decoded, bytes);
    bytes.push_back(static_cast<std::byte>(n * 37 + 11));
  }
  const std::string_view foobar = "foob";
  EXPECT_EQ(encode_base64(std::as_bytes(std::span(foobar))), "Zm9vYg==");
}

}  // namespace
}  // namespace shoal::testing
