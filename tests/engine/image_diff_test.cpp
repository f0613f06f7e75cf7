#include "engine/image_diff.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace shoal {
namespace {

ExrImage picture(uint32_t width, uint32_t height, const std::vector<std::string>& names) {
  ExrImage image;
  image.width = width, image.height = height;
  float value = 0.25f;
  for (const std::string& name : names) {
    ExrChannel channel;
    channel.name = name;
    for (uint32_t i = 0; i < width * height; ++i) channel.values.push_back(value += 0.125f);
    image.channels.push_back(channel);
  }
  return image;
}

TEST(ImageDiff, EqualPicturesAreIdenticalWhateverTheOrderOfTheirChannels) {
  const ExrImage a = picture(4, 3, {"R", "G", "B"});
  ExrImage b = a;
  std::swap(b.channels[0], b.channels[2]);
  const ImageDiff diff = diff_images(a, b);
  EXPECT_TRUE(diff.identical);
  EXPECT_EQ(diff.pixels_count, 12u);
  EXPECT_EQ(diff_text(diff), "identical: 12 pixels, 3 channels, every bit equal");
}

TEST(ImageDiff, IntegersAreComparedAsSuch) {
  ExrImage a = picture(2, 1, {"object_id.Y"});
  a.channels[0].values = {16777216.0f, 5.0f};
  a.channels[0].integers = {16777216, 5};
  ExrImage b = a;
  EXPECT_TRUE(diff_images(a, b).identical);
  b.channels[0].integers[0] = 16777217;  // the same float
  const ImageDiff diff = diff_images(a, b);
  EXPECT_FALSE(diff.identical);
  EXPECT_EQ(diff.channels[0].differing_count, 1u);
  EXPECT_TRUE(diff.first.found);
}

TEST(ImageDiff, NamesOfChannelsAreMadePrintableBeforeTheyAreShown) {
  const std::string bell = "R\x1b]0;title\x07", line = "G\nidentical: 2 pixels";
  const ExrImage a = picture(2, 1, {bell, line});
  ExrImage b = picture(2, 1, {bell});
  b.channels[0].values[0] = 7;
  const ImageDiff diff = diff_images(a, b);
  const std::string text = diff_text(diff);
  EXPECT_NE(text.find("channel R?]0;title?: "), std::string::npos) << text;
  EXPECT_NE(text.find("channel G?identical: 2 pixels is in the first picture only"), std::string::npos) << text;
  EXPECT_EQ(text.find_first_of("\x1b\x07"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(diff_json(diff))["channels"][0]["name"], bell);  // escaped there
}

TEST(ImageDiff, OneBitIsADifferenceAndIsFound) {
  const ExrImage a = picture(4, 3, {"R", "G", "B"});
  ExrImage b = a;
  float& value = b.channels[1].values[2 * 4 + 1];
  value = std::nextafter(value, 10.0f);
  const ImageDiff diff = diff_images(a, b);
  EXPECT_FALSE(diff.identical);
  EXPECT_TRUE(diff.comparable);
  EXPECT_EQ(diff.differing_pixels_count, 1u);
  EXPECT_TRUE(diff.first.found);
  EXPECT_EQ(diff.first.x, 1u);
  EXPECT_EQ(diff.first.y, 2u);
  EXPECT_EQ(diff.first.channel, "G");
  EXPECT_EQ(diff.first.b, value);
  EXPECT_NE(diff_text(diff).find("(1, 2), channel G"), std::string::npos) << diff_text(diff);
}

TEST(ImageDiff, SignedZerosDifferAndEqualNotANumbersDoNot) {
  ExrImage a = picture(2, 1, {"R"}), b = a;
  a.channels[0].values = {0.0f, std::numeric_limits<float>::quiet_NaN()};
  b.channels[0].values = {-0.0f, std::numeric_limits<float>::quiet_NaN()};
  const ImageDiff diff = diff_images(a, b);
  EXPECT_FALSE(diff.identical);
  EXPECT_EQ(diff.differing_pixels_count, 1u);
  EXPECT_EQ(diff.channels[0].non_finite_count, 1u);
  EXPECT_EQ(diff.channels[0].rmse, 0);
}

TEST(ImageDiff, StatisticsAreThoseOfTheDefinition) {
  ExrImage a = picture(2, 1, {"R"}), b = a;
  a.channels[0].values = {1.0f, 3.0f};
  b.channels[0].values = {2.0f, 1.0f};
  const ChannelDiff channel = diff_images(a, b).channels[0];
  EXPECT_DOUBLE_EQ(channel.max_absolute, 2);
  EXPECT_DOUBLE_EQ(channel.max_relative, 2.0 / 3);
  EXPECT_DOUBLE_EQ(channel.mean, 0.5);
  EXPECT_DOUBLE_EQ(channel.rmse, std::sqrt(2.5));
  EXPECT_DOUBLE_EQ(channel.relative_mse, (1 / 4.01 + 4 / 1.01) / 2);
  EXPECT_EQ(channel.differing_count, 2u);
}

TEST(ImageDiff, ColorJoinsRedGreenAndBlueOnly) {
  ExrImage a = picture(1, 1, {"B", "G", "R", "Z"}), b = a;
  b.channels[0].values[0] += 3, b.channels[3].values[0] += 100;
  const ImageDiff diff = diff_images(a, b);
  EXPECT_DOUBLE_EQ(diff.color.max_absolute, 3);
  EXPECT_DOUBLE_EQ(diff.color.mean, -1);
  EXPECT_EQ(diff.channels.size(), 4u);
}

TEST(ImageDiff, ChannelsOfOnePictureOnlyAreNamed) {
  const ExrImage a = picture(2, 2, {"R", "Z"}), b = picture(2, 2, {"R", "albedo.R"});
  const ImageDiff diff = diff_images(a, b);
  EXPECT_TRUE(diff.comparable);
  EXPECT_FALSE(diff.identical);
  ASSERT_EQ(diff.notes.size(), 2u);
  EXPECT_NE(diff.notes[0].find("Z is in the first"), std::string::npos);
  EXPECT_NE(diff.notes[1].find("albedo.R is in the second"), std::string::npos);
  EXPECT_EQ(diff.channels.size(), 1u);
}

TEST(ImageDiff, CostMapsAreComparedOnlyWhenAskedFor) {
  const ExrImage a = picture(2, 2, {"R", "treelets.visited"});
  ExrImage b = a;
  b.channels[1].values[0] = 7;
  EXPECT_TRUE(diff_images(a, b).identical);
  EXPECT_FALSE(diff_images(a, b, {.cost_maps = true}).identical);
}

TEST(ImageDiff, PicturesOfDifferentSizesAreNotCompared) {
  const ImageDiff diff = diff_images(picture(2, 2, {"R"}), picture(2, 3, {"R"}));
  EXPECT_FALSE(diff.comparable);
  EXPECT_FALSE(diff.identical);
  EXPECT_NE(diff_text(diff).find("2x2 at (0, 0) and 2x3 at (0, 0)"), std::string::npos) << diff_text(diff);
}

TEST(ImageDiff, JsonHoldsWhatWasFound) {
  const ExrImage a = picture(2, 2, {"R"});
  ExrImage b = a;
  b.channels[0].values[3] = 9;
  const auto json = nlohmann::json::parse(diff_json(diff_images(a, b)));
  EXPECT_EQ(json["identical"], false);
  EXPECT_EQ(json["differing_pixels_count"], 1);
  EXPECT_EQ(json["first"]["x"], 1);
  EXPECT_EQ(json["first"]["y"], 1);
  EXPECT_EQ(json["channels"][0]["name"], "R");
}

TEST(ImageDiff, FlipIsThereOnlyWhenAskedForAndWithAllThreeColours) {
  const ExrImage a = picture(4, 4, {"R", "G", "B"});
  ExrImage b = a;
  EXPECT_FALSE(diff_images(a, b).mean_flip.has_value());
  EXPECT_EQ(diff_images(a, b, {.flip = true}).mean_flip, 0);
  for (float& value : b.channels[0].values) value *= 3;
  const ImageDiff diff = diff_images(a, b, {.flip = true});
  ASSERT_TRUE(diff.mean_flip.has_value());
  EXPECT_GT(*diff.mean_flip, 0.1);
  EXPECT_NE(diff_text(diff).find("HDR-FLIP, mean: 0."), std::string::npos) << diff_text(diff);
  EXPECT_GT(nlohmann::json::parse(diff_json(diff))["mean_hdr_flip"], 0.1);
  EXPECT_FALSE(diff_images(picture(2, 2, {"R"}), picture(2, 2, {"R"}), {.flip = true}).mean_flip.has_value());
}

}  // namespace
}  // namespace shoal
