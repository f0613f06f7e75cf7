// The picture to look at while rendering: what it shows of an unfinished film, when, and what happens when it cannot
// be written.
#include "engine/preview.h"

#include <gtest/gtest.h>

#include "io/image.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"

namespace shoal {
namespace {

constexpr uint32_t kWidth = 150, kHeight = 70;  // the first lattice: every second pixel in x and y
const PreviewOptions kOptions{"preview.png", {}};

struct PreviewTest : ::testing::Test {
  /// Adds the samples [first, last) in the order of `samples`; each is of its pixel's own colour.
  void add(uint64_t first, uint64_t last) {
    for (uint64_t index = first; index < last; ++index) {
      const PixelSample s = samples.at(index);
      film.add(s.y * kWidth + s.x, color(s.x, s.y), true);
    }
  }
  static Vec3 color(uint32_t x, uint32_t y) { return {static_cast<float>(x) / kWidth, static_cast<float>(y) / kHeight, 0.5f}; }
  static std::vector<uint8_t> encoded(const Vec3& c) { return tone_map_image({&c.x, 1}, {&c.y, 1}, {&c.z, 1}, {}); }

  std::vector<uint8_t> shown(uint32_t x, uint32_t y) {
    const auto image = decode_image(files.contents("preview.png"), "preview.png", 1 << 20);
    EXPECT_TRUE(image.ok());
    if (!image.ok() || image.value().width != kWidth || image.value().height != kHeight) return {};
    const uint8_t* rgba = &image.value().rgba[(size_t{y} * kWidth + x) * 4];
    return {rgba, rgba + 3};
  }

  MemoryFileSystem files;
  FaultyFileSystem faulty{files};
  Film film{kWidth, kHeight};
  SampleOrder samples{kWidth, kHeight, 2, 1, SampleOrder::kAllLevels};
  std::vector<std::string> warnings;
  std::function<void(const std::string&)> warning = [this](const std::string& message) { warnings.push_back(message); };
};

TEST_F(PreviewTest, NothingIsShownBeforeTheFirstLatticeIsComplete) {
  Preview shown(files, kOptions, film, samples, 1, 0, warning);
  ASSERT_EQ(samples.first_spacing(), 2u);
  const uint64_t first = samples.first_lattice_count();
  add(0, first - 1);
  shown.show_when_due(first - 1);
  EXPECT_FALSE(shown.first());
  EXPECT_FALSE(files.exists("preview.png"));
  add(first - 1, first);
  shown.show_when_due(first);
  ASSERT_TRUE(shown.first());
  EXPECT_EQ(shown.first()->pixel_share, static_cast<double>(first) / (kWidth * kHeight));
  EXPECT_EQ(files.names(), std::vector<std::string>{"preview.png"});
  shown.show_when_due(first + 1);
  EXPECT_EQ(shown.shown_count(), 1u) << "the next is not due for seconds";
}

TEST_F(PreviewTest, PixelsWithoutSamplesShowTheNearestOfTheLattice) {
  Preview coarse(files, kOptions, film, samples, 1, 0, warning);
  add(0, samples.first_lattice_count());
  coarse.show_if_none();
  EXPECT_EQ(shown(40, 20), encoded(color(40, 20)));
  EXPECT_EQ(shown(41, 20), encoded(color(42, 20)));
  EXPECT_EQ(shown(41, 21), encoded(color(42, 22)));
  EXPECT_EQ(shown(kWidth - 1, kHeight - 1), encoded(color(kWidth - 2, kHeight - 2)));
}

TEST_F(PreviewTest, APixelOfItsOwnSamplesShowsTheirMean) {
  Preview mixed(files, kOptions, film, samples, 1, 0, warning);
  add(0, samples.first_lattice_count());
  film.add(20 * kWidth + 41, Vec3(0.25f), true);
  film.add(20 * kWidth + 41, Vec3(0.75f), true);
  mixed.show_if_none();
  EXPECT_EQ(shown(41, 20), encoded(Vec3(0.5f)));
  EXPECT_EQ(shown(41, 21), encoded(color(42, 22))) << "it is of no lattice that is shown there";
}

TEST_F(PreviewTest, ACompleteFilmIsShownAsTheFinishedPicture) {
  Preview whole(files, kOptions, film, samples, 1, 0, warning);
  add(0, samples.count());
  whole.show_when_due(samples.count());
  ASSERT_TRUE(whole.first());
  EXPECT_EQ(whole.first()->pixel_share, 1.0);
  const std::vector<float> rgba = film.resolve();
  for (uint32_t i = 0; i < kWidth * kHeight; i += 97) {
    EXPECT_EQ(shown(i % kWidth, i / kWidth), encoded({rgba[i * 4], rgba[i * 4 + 1], rgba[i * 4 + 2]})) << i;
  }
}

TEST_F(PreviewTest, ADiskThatIsFullIsSaidOnceAndLeavesNothing) {
  Preview failing(faulty, kOptions, film, samples, 1, 0, warning);
  add(0, samples.first_lattice_count());
  faulty.arm(Fault::kDiskFull, 1, true);  // the file can be made, but not filled
  failing.show_if_none();
  failing.show_if_none();
  EXPECT_FALSE(failing.first());
  EXPECT_EQ(failing.shown_count(), 0u);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("the preview could not be written: "), std::string::npos) << warnings[0];
  EXPECT_TRUE(files.names().empty());
  faulty.arm(Fault::kNone, 0);
  failing.show_if_none();
  EXPECT_TRUE(failing.first());
  EXPECT_EQ(files.names(), std::vector<std::string>{"preview.png"});
}

TEST_F(PreviewTest, AFailedRefreshLeavesThePictureBefore) {
  Preview before(files, kOptions, film, samples, 1, 0, warning), after(faulty, kOptions, film, samples, 1, 0, warning);
  add(0, samples.first_lattice_count());
  before.show_if_none();
  const std::vector<std::byte> old = files.contents("preview.png");
  add(samples.first_lattice_count(), samples.count());
  faulty.arm(Fault::kIoError, 1, true);
  after.show_if_none();
  EXPECT_EQ(warnings.size(), 1u);
  EXPECT_EQ(files.contents("preview.png"), old);
  EXPECT_EQ(files.names(), std::vector<std::string>{"preview.png"});
}

}  // namespace
}  // namespace shoal
