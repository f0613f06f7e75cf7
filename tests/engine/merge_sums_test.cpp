// Parts of a picture, each of a range of samples and rendered in a way of its own, have together the bits of one
// render; what is not the whole of one picture is refused.
#include "engine/merge_sums.h"

#include <sys/resource.h>

#include "engine/picture_attributes.h"
#include "engine/render_report.h"
#include "engine/sums_file.h"
#include "tests/engine/stopped_render.h"
#include "tests/support/same_bits.h"

namespace shoal::testing {
namespace {

class MergeSums : public StoppedRender {
 protected:
  void render_part(const std::string& path, SampleSpan range, const RenderVariation& way = kRenderWays[0]) {
    sums_path_ = path;
    picture_.range = range;
    const auto result = rendered(files_, way, {});
    sums_path_.clear();
    picture_.range = {};
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_TRUE(result.value().rgba.empty());
    EXPECT_TRUE(files_.exists(path));
  }

  void expect_refused(const std::vector<std::string>& parts, const std::string& why,
                      ErrorCode code = ErrorCode::kInput) {
    const auto merged = merge_parts(files_, parts);
    ASSERT_FALSE(merged.ok()) << why;
    EXPECT_EQ(merged.error().code, code) << merged.error().message;
    EXPECT_NE(merged.error().message.find(why), std::string::npos) << merged.error().message;
  }
};

TEST_F(MergeSums, PartsHaveTheBitsOfOneRender) {
  picture_.samples = 7;
  render_part("a", {0, 1}, kRenderWays[0]);
  render_part("b", {1, 4}, kRenderWays[2]);
  render_part("c", {4, 7}, kRenderWays[8]);
  const RenderResult expected = whole();
  const auto merged = merge_parts(files_, {"c", "a", "b"});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged.value().samples, 7u);
  EXPECT_GT(merged.value().seconds, 0);
  const auto scene = open_scene(posix_file_system(), folder_ / "scene.shoal", ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  const ExrImage one = picture_image(expected, scene.value(), picture_);
  const ExrImage& image = merged.value().image;
  ASSERT_EQ(image.channels.size(), one.channels.size());
  for (size_t i = 0; i < one.channels.size(); ++i) {
    const ExrChannel &a = image.channels[i], &b = one.channels[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.integers, b.integers) << b.name;
    EXPECT_TRUE(same_bits(a.values, b.values)) << b.name;
  }
  EXPECT_EQ(image.text, one.text);
  EXPECT_EQ(image.matrices, one.matrices);
  EXPECT_EQ(image.numbers.at("samplesPerPixel"), 7);
}

TEST_F(MergeSums, APartCanBeStoppedAndGoneOnWith) {
  picture_.samples = 6;
  render_part("a", {0, 2});
  picture_.range = {2, 6};
  sums_path_ = "b";
  for (double seconds = 0.02; !files_.exists(kCheckpoint); seconds *= 0.7) {
    files_.remove("b").ok();
    (void)stopped_after(seconds, kRenderWays[1], files_);
  }
  EXPECT_TRUE(resumed(kRenderWays[3]).ok());
  sums_path_.clear();
  picture_.range = {};
  const auto merged = merge_parts(files_, {"a", "b"});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  const RenderResult expected = whole();
  for (size_t c = 0; c < 4; ++c) {
    for (size_t i = 0; i < expected.rgba.size() / 4; ++i) {
      ASSERT_EQ(merged.value().image.channels[c].values[i], expected.rgba[4 * i + c]);
    }
  }
}

TEST_F(MergeSums, WhatIsNotTheWholeOfOnePictureIsRefused) {
  render_part("0:2", {0, 2});
  render_part("1:4", {1, 4});
  render_part("2:3", {2, 3});
  render_part("3:4", {3, 4});
  EXPECT_TRUE(merge_parts(files_, {"0:2", "2:3", "3:4"}).ok());
  expect_refused({}, "no parts");
  expect_refused({"none"}, "none");
  expect_refused({"0:2", "3:4"}, "samples 2:3 are in no part");
  expect_refused({"0:2", "2:3"}, "samples 3:4 are in no part");
  expect_refused({"2:3", "3:4"}, "samples 0:2 are in no part");
  expect_refused({"0:2", "1:4"}, "both have samples 1:2");
  expect_refused({"0:2", "0:2", "2:3", "3:4"}, "both have samples 0:2");
  picture_.shading.seed = 3;
  render_part("other", {2, 4});
  expect_refused({"0:2", "other"}, "seed is 3, not 0");
  picture_.shading.seed = 0;
  make_checkpoint();
  expect_refused({kCheckpoint}, "--resume");
  files_.put("text", std::string(1000, 'x'));
  expect_refused({"text"}, "no part of a picture");
}

TEST_F(MergeSums, PartsCanBeAddedForMoreSamplesThanWereAskedForFirst) {
  render_part("0:4", {0, 4});
  picture_.samples = 9;
  render_part("4:9", {4, 9}, kRenderWays[3]);
  expect_refused({"4:9"}, "samples 0:4 are in no part");
  const auto merged = merge_parts(files_, {"0:4", "4:9"});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged.value().image.channels[1].values[77], whole().rgba[4 * 77 + 1]);
}

TEST_F(MergeSums, ADamagedPartIsRefused) {
  render_part("0:2", {0, 2});
  render_part("2:4", {2, 4});
  const std::vector<std::byte> bytes = files_.contents("2:4");
  std::mt19937 random(5);
  for (uint32_t n = 0; n < 60; ++n) {
    std::vector<std::byte> bad = bytes;
    if (n % 2 == 0) bad[random() % bad.size()] ^= std::byte{4};
    if (n % 2 == 1) bad.resize(random() % bad.size());
    files_.put("2:4", bad);
    const auto merged = merge_parts(files_, {"0:2", "2:4"});
    ASSERT_FALSE(merged.ok());
    EXPECT_TRUE(merged.error().code == ErrorCode::kCorrupt || merged.error().code == ErrorCode::kInput);
    EXPECT_NE(merged.error().message.find("2:4"), std::string::npos) << merged.error().message;
  }
}

TEST(SampleRange, RangesThatCannotBeAreRefused) {
  PictureOptions picture;
  picture.samples = 4;
  for (const SampleSpan range : {SampleSpan{2, 2}, SampleSpan{3, 1}, SampleSpan{0, 5}}) {
    picture.range = range;
    EXPECT_EQ(check_picture(picture).error().code, ErrorCode::kUsage) << range.begin << ":" << range.end;
  }
  picture.range = {0, 2};
  EXPECT_TRUE(check_picture(picture).ok());
  picture.noise = parse_noise_target("2%").value();
  EXPECT_EQ(check_picture(picture).error().code, ErrorCode::kUsage);
}

TEST_F(MergeSums, ThereCanBeMorePartsThanFilesOpenAtOnce) {
  constexpr uint32_t kParts = 200;
  std::vector<std::string> parts;
  for (uint32_t i = 0; i < kParts; ++i) {
    Film film(2, 1);
    film.add(1, Vec3(static_cast<float>(i)), true);
    SumsHeader header;
    header.kind = SumsKind::kPart;
    header.samples = kParts, header.range = {i, i + 1};
    parts.push_back(folder_ / ("part" + std::to_string(i)));
    const Status written =
        write_sums(posix_file_system(), parts.back(), header, "scene\n", attributes_text({}), {film}, nullptr);
    ASSERT_TRUE(written.ok()) << written.error().message;
  }
  rlimit usual{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &usual), 0);
  const rlimit few{kParts / 2, usual.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  const auto merged = merge_parts(posix_file_system(), parts);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &usual), 0);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged.value().samples, kParts);
  EXPECT_EQ(merged.value().image.channels.front().values[1], (kParts - 1) / 2.0f);
}

}  // namespace
}  // namespace shoal::testing
