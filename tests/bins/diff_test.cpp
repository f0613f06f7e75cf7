// shoal diff: 0 when every bit is equal, 10 and by how much when not.
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/image.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;

void put_picture(const std::string& path, uint32_t width, float last) {
  ExrImage image;
  image.width = width;
  image.height = 2;
  for (const char* name : {"R", "G", "B", "A"})
    image.channels.push_back({name, false, std::vector<float>(width * 2, 0.5f)});
  image.channels[1].values.back() = last;
  const Status written = write_exr(posix_file_system(), path, image);
  ASSERT_TRUE(written.ok()) << written.error().message;
}

TEST(Diff, IdenticalPicturesExitZero) {
  const TemporaryFolder folder;
  put_picture(folder / "a.exr", 4, 0.25f);
  put_picture(folder / "b.exr", 4, 0.25f);
  const ProgramRun run = run_shoal(folder, {"diff", folder / "a.exr", folder / "b.exr"});
  expect_exit(run, 0);
  EXPECT_THAT(run.out, HasSubstr("identical"));
  const ProgramRun as_json = run_shoal(folder, {"diff", "--json", folder / "a.exr", folder / "b.exr"});
  expect_exit(as_json, 0);
  EXPECT_EQ(nlohmann::json::parse(as_json.out)["identical"], true);
}

TEST(Diff, OneBitExitsTenAndIsFound) {
  const TemporaryFolder folder;
  put_picture(folder / "a.exr", 4, 0.25f);
  put_picture(folder / "b.exr", 4, std::nextafter(0.25f, 1.0f));
  const ProgramRun run = run_shoal(folder, {"diff", folder / "a.exr", folder / "b.exr"});
  expect_exit(run, 10);
  EXPECT_THAT(run.out, HasSubstr("1 of 8 pixels"));
  const ProgramRun as_json = run_shoal(folder, {"diff", "--json", folder / "a.exr", folder / "b.exr"});
  expect_exit(as_json, 10);
  const nlohmann::json diff = nlohmann::json::parse(as_json.out);
  EXPECT_EQ(diff["identical"], false);
  EXPECT_EQ(diff["differing_pixels_count"], 1);
}

TEST(Diff, OtherSizesExitTen) {
  const TemporaryFolder folder;
  put_picture(folder / "a.exr", 4, 0.25f);
  put_picture(folder / "b.exr", 5, 0.25f);
  const ProgramRun run = run_shoal(folder, {"diff", folder / "a.exr", folder / "b.exr"});
  expect_exit(run, 10);
  EXPECT_THAT(run.out, HasSubstr("4x2"));
}

}  // namespace
}  // namespace shoal::testing
