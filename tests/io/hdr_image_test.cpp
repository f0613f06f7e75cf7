#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "io/exr_header.h"
#include "io/image.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"

namespace shoal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr uint64_t kPixels = 1 << 20;

ExrImage make_exr(uint32_t width, uint32_t height) {
  ExrImage image;
  image.width = width;
  image.height = height;
  std::mt19937 random(1);
  for (const char* name : {"R", "G", "B", "A", "normal.X", "Z"}) {
    ExrChannel channel{name, std::string(name) == "Z", {}};
    for (uint32_t i = 0; i < width * height; ++i) {
      // Halves hold multiples of 1/8 up to 64 exactly.
      channel.values.push_back(channel.half ? static_cast<float>(random() % 512) / 8
                                            : static_cast<float>(random()) * 1e-5f);
    }
    image.channels.push_back(channel);
  }
  image.text["software"] = "shoal";
  image.numbers["renderTimeSeconds"] = 1.5f;
  image.matrices["worldToCamera"] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  return image;
}

ExrImage one_row(const ExrChannel& channel) {
  ExrImage image;
  image.width = static_cast<uint32_t>(channel.values.size());
  image.height = 1;
  image.channels = {channel};
  return image;
}

TEST(Exr, ReadsBackIntegers) {
  ExrImage image = one_row({"R", false, {0.5f, 1, 2}});
  image.channels.push_back({"object_id.Y", false, {}, {0, 16777217, 0xffffffffu}});
  MemoryFileSystem fs;
  ASSERT_TRUE(write_exr(fs, "out.exr", image).ok());
  const auto read = read_exr(fs, "out.exr", kPixels);
  ASSERT_TRUE(read.ok()) << read.error().message;
  for (const ExrChannel& channel : read.value().channels) {
    if (channel.name == "R") {
      EXPECT_EQ(channel.values, image.channels[0].values);
      EXPECT_THAT(channel.integers, IsEmpty());
    } else {
      EXPECT_EQ(channel.integers, image.channels[1].integers);
      EXPECT_EQ(channel.values[1], 16777216.0f) << "beside them, rounded";
    }
  }
}

TEST(Exr, ReadsBackEveryChannelAndAttributeThatWasWritten) {
  ExrImage image = make_exr(37, 150);
  image.data_x = 5;
  image.data_y = 7;
  image.display_width = 640;
  image.display_height = 480;
  MemoryFileSystem fs;
  const Status written = write_exr(fs, "out.exr", image);
  ASSERT_TRUE(written.ok()) << written.error().message;
  EXPECT_THAT(fs.names(), ElementsAre("out.exr"));
  const auto read = read_exr(fs, "out.exr", kPixels);
  ASSERT_TRUE(read.ok()) << read.error().message;
  const ExrImage& back = read.value();
  EXPECT_EQ(back.width, 37u);
  EXPECT_EQ(back.height, 150u);
  EXPECT_EQ(back.data_x, 5);
  EXPECT_EQ(back.data_y, 7);
  EXPECT_EQ(back.display_width, 640u);
  EXPECT_EQ(back.display_height, 480u);
  EXPECT_EQ(back.text.at("software"), "shoal");
  EXPECT_EQ(back.numbers.at("renderTimeSeconds"), 1.5f);
  EXPECT_EQ(back.matrices.at("worldToCamera"), image.matrices.at("worldToCamera"));
  ASSERT_EQ(back.channels.size(), image.channels.size());
  for (const ExrChannel& channel : image.channels) {
    const auto it = std::find_if(back.channels.begin(), back.channels.end(),
                                 [&](const ExrChannel& other) { return other.name == channel.name; });
    ASSERT_NE(it, back.channels.end()) << channel.name;
    EXPECT_EQ(it->half, channel.half);
    EXPECT_EQ(it->values, channel.values) << channel.name;
  }
}

TEST(Exr, KeepsFiniteValuesFiniteInHalfAndPassesOthersOn) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const ExrImage image = one_row({"Y", true, {1e6f, -1e6f, kInfinity, std::numeric_limits<float>::quiet_NaN()}});
  MemoryFileSystem fs;
  ASSERT_TRUE(write_exr(fs, "out.exr", image).ok());
  const auto read = read_exr(fs, "out.exr", kPixels);
  ASSERT_TRUE(read.ok()) << read.error().message;
  const auto& values = read.value().channels[0].values;
  EXPECT_EQ(values[0], 65504);
  EXPECT_EQ(values[1], -65504);
  EXPECT_EQ(values[2], kInfinity);
  EXPECT_TRUE(std::isnan(values[3]));
}

TEST(Exr, LeavesNothingBehindWhenTheDiskIsFull) {
  const ExrImage image = make_exr(64, 200);
  for (uint64_t call = 0;; ++call) {
    MemoryFileSystem memory;
    FaultyFileSystem fs(memory);
    fs.arm(Fault::kDiskFull, call, true);
    const Status status = write_exr(fs, "out.exr", image);
    if (status.ok()) {
      EXPECT_GT(call, 3u);
      break;
    }
    EXPECT_EQ(status.error().code, ErrorCode::kStorage) << status.error().message;
    EXPECT_THAT(memory.names(), IsEmpty());
  }
}

TEST(Exr, RefusesPicturesThatAreTooLargeBeforeReadingThem) {
  MemoryFileSystem fs;
  ASSERT_TRUE(write_exr(fs, "out.exr", make_exr(64, 64)).ok());
  EXPECT_TRUE(read_exr(fs, "out.exr", 64 * 64 * 6 / 4).ok());
  const auto read = read_exr(fs, "out.exr", 64 * 64);
  ASSERT_FALSE(read.ok());  // six channels pass the budget of four
  EXPECT_THAT(read.error().message, HasSubstr("64 x 64 of 6 channels"));
}

TEST(Exr, RefusesFilesCutOffAnywhere) {
  MemoryFileSystem fs;
  ASSERT_TRUE(write_exr(fs, "out.exr", make_exr(9, 40)).ok());
  const auto bytes = fs.contents("out.exr");
  for (size_t size = 0; size < bytes.size(); size += 7) {
    fs.put("cut.exr", std::vector<std::byte>(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size)));
    const auto read = read_exr(fs, "cut.exr", kPixels);
    ASSERT_FALSE(read.ok()) << size << " of " << bytes.size();
    ASSERT_EQ(read.error().code, ErrorCode::kInput);
  }
}

/// What the check says of a good file with one attribute more, in front; empty when it takes it.
std::string with_attribute(const std::string& name, const std::string& type, const std::string& value) {
  MemoryFileSystem fs;
  EXPECT_TRUE(write_exr(fs, "out.exr", make_exr(4, 4)).ok());
  const auto size = static_cast<uint32_t>(value.size());
  const std::string text = name + '\0' + type + '\0' + std::string(reinterpret_cast<const char*>(&size), 4) + value;
  const auto more = std::as_bytes(std::span(text));
  auto bytes = fs.contents("out.exr");
  bytes.insert(bytes.begin() + 8, more.begin(), more.end());
  fs.put("more.exr", bytes);
  const auto found = check_exr_header(*fs.open("more.exr", ReadMode::kBuffered).value(), kPixels);
  return found.ok() ? "" : found.error().message;
}

// The library goes by an attribute's type: what it reads would be another header than the one that was checked.
TEST(Exr, RefusesAttributesThatAreNotAsLongAsTheirType) {
  const auto refused = [](const char* type, const std::string& value) {
    const std::string expected = "sky: " + std::to_string(value.size()) + " bytes are no value of type " + type;
    EXPECT_THAT(with_attribute("sky", type, value), HasSubstr(expected));
  };
  EXPECT_EQ(with_attribute("sky", "float", std::string(4, '\0')), "");
  EXPECT_EQ(with_attribute("sky", "unheard of", std::string(199, 'x')), "");
  EXPECT_EQ(with_attribute("sky", "stringvector", std::string("\2\0\0\0ab\0\0\0\0", 10)), "");
  EXPECT_EQ(with_attribute("sky", "preview", std::string("\1\0\0\0\1\0\0\0rgba", 12)), "");
  refused("float", std::string(199, '\0'));
  refused("lineOrder", "");
  refused("stringvector", std::string("\2\0\0\1ab", 6));
  refused("preview", std::string("\0\0\1\0\0\0\1\0rgba", 12));
  refused("idmanifest", std::string(40, '\1'));
  refused("chlist", std::string(1, '\0'));
}

// Channels of a second list would be added to those of the first.
TEST(Exr, RefusesAnAttributeThatComesTwice) {
  const std::string channel("Q\0\2\0\0\0\0\0\0\0\1\0\0\0\1\0\0\0\0", 19);
  EXPECT_THAT(with_attribute("channels", "chlist", channel), HasSubstr("channels: expected an attribute once"));
}

TEST(HdrImage, ReadsTheColoursOrTheLuminanceOfAnExr) {
  MemoryFileSystem fs;
  const ExrImage exr = make_exr(5, 4);
  ASSERT_TRUE(write_exr(fs, "a.exr", exr).ok());
  const auto rgb = read_hdr_image(fs, "a.exr", kPixels);
  ASSERT_TRUE(rgb.ok()) << rgb.error().message;
  for (size_t i = 0; i < 20; ++i) {
    for (size_t c = 0; c < 3; ++c) ASSERT_EQ(rgb.value().rgb[3 * i + c], exr.channels[c].values[i]);
  }
  ASSERT_TRUE(write_exr(fs, "y.exr", one_row({"Y", false, {3, 4}})).ok());
  EXPECT_THAT(read_hdr_image(fs, "y.exr", kPixels).value().rgb, ElementsAre(3, 3, 3, 4, 4, 4));
  ASSERT_TRUE(write_exr(fs, "z.exr", one_row({"Z", false, {3}})).ok());
  EXPECT_FALSE(read_hdr_image(fs, "z.exr", kPixels).ok());
}

Result<ImageF> read_radiance(const std::string& size, const std::vector<uint8_t>& body) {
  std::string text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size + "\n";
  for (const uint8_t byte : body) text += static_cast<char>(byte);
  MemoryFileSystem fs;
  fs.put("a.hdr", text);
  return read_hdr_image(fs, "a.hdr", kPixels);
}

TEST(HdrImage, ReadsFlatRadiancePixels) {
  const auto image = read_radiance("-Y 1 +X 3", {128, 64, 0, 129, 255, 1, 2, 137, 9, 9, 9, 0});
  ASSERT_TRUE(image.ok()) << image.error().message;
  EXPECT_THAT(image.value().rgb, ElementsAre(1, 0.5f, 0, 510, 2, 4, 0, 0, 0));
}

TEST(HdrImage, ReadsOldRunLengths) {
  // One pixel, repeated 2 times, then 1 * 256 + 0 by two counts: 1 + 2 + 1 + 256.
  const auto image =
      read_radiance("-Y 1 +X 260", {128, 0, 0, 129, 1, 1, 1, 2, 0, 128, 0, 129, 1, 1, 1, 0, 1, 1, 1, 1});
  ASSERT_TRUE(image.ok()) << image.error().message;
  EXPECT_EQ(image.value().rgb[0], 1);
  EXPECT_EQ(image.value().rgb[3 * 2], 1);
  EXPECT_EQ(image.value().rgb[3 * 3], 0);
  EXPECT_EQ(image.value().rgb[3 * 3 + 1], 1);
  EXPECT_EQ(image.value().rgb[3 * 259 + 1], 1);
}

TEST(HdrImage, ReadsNewRunLengths) {
  const auto image = read_radiance("-Y 1 +X 8", {2, 2, 0, 8, 136, 128, 3, 1, 2, 3, 133, 4, 136, 0, 136, 129});
  ASSERT_TRUE(image.ok()) << image.error().message;
  for (size_t x = 0; x < 8; ++x) {
    EXPECT_EQ(image.value().rgb[3 * x], 1);
    EXPECT_EQ(image.value().rgb[3 * x + 1], static_cast<float>(x < 3 ? x + 1 : 4) / 128);
    EXPECT_EQ(image.value().rgb[3 * x + 2], 0);
  }
}

TEST(HdrImage, RefusesBrokenRadianceFiles) {
  EXPECT_FALSE(read_radiance("-Y 1 +X 3", {128, 64, 0, 129}).ok());
  EXPECT_FALSE(read_radiance("-Y 1 +X 2", {1, 1, 1, 2}).ok());                // repeats nothing
  EXPECT_FALSE(read_radiance("-Y 1 +X 2", {5, 5, 5, 5, 1, 1, 1, 200}).ok());  // repeats too often
  EXPECT_FALSE(read_radiance("-Y 1 +X 8", {2, 2, 0, 9, 136, 128}).ok());      // another width
  EXPECT_FALSE(read_radiance("-Y 1 +X 8", {2, 2, 0, 8, 137, 128}).ok());      // a run past the end
  EXPECT_FALSE(read_radiance("-Y 1 +X 8", {2, 2, 0, 8, 0, 0, 0, 0}).ok());    // a run of nothing
  EXPECT_FALSE(read_radiance("-Y 0 +X 8", {}).ok());
  EXPECT_FALSE(read_radiance("-Y 4000 +X 4000", {}).ok());  // over the budget
  EXPECT_FALSE(read_radiance("-Y 99999999999 +X 1", {}).ok());
  EXPECT_FALSE(read_radiance("+X 1 -Y 1", {1, 2, 3, 4}).ok());
}

}  // namespace
}  // namespace shoal
