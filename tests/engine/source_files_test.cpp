#include "engine/source_files.h"

#include <gtest/gtest.h>

#include <functional>

#include "engine/build_scene.h"
#include "engine/scene.h"
#include "tests/engine/bad_luck_scene.h"

namespace shoal::testing {
namespace {

class SourceFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { save_bad_luck_scene(fs_, 50); }

  Result<SceneBuildReport> build(std::function<void()> in_the_middle = nullptr) {
    SceneBuildOptions options;
    options.threads = 1;
    options.progress = [&](const BuildProgress& progress) {
      if (in_the_middle && std::string(progress.stage) == "textures") std::exchange(in_the_middle, nullptr)();
    };
    return build_scene(fs_, "scene.gltf", "scene.shoal", options);
  }

  /// What a render of scene.shoal says of its source.
  Status check() {
    const auto scene = open_scene(fs_, "scene.shoal", ReadMode::kBuffered, {});
    EXPECT_TRUE(scene.ok()) << scene.error().message;
    return check_source_is_unchanged(fs_, scene.value());
  }

  void expect_stale(const std::string& file, const std::string& how) {
    const Status status = check();
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kInput);
    for (const std::string& part : {std::string("scene.shoal is out of date"), file, how, std::string("--allow-stale")}) {
      EXPECT_NE(status.error().message.find(part), std::string::npos) << part << " in: " << status.error().message;
    }
  }

  void put_longer(const std::string& name) {
    auto bytes = fs_.contents(name);
    bytes.insert(bytes.end(), 3, std::byte{' '});
    fs_.put(name, bytes);
  }

  MemoryFileSystem fs_;
};

TEST_F(SourceFilesTest, AnUnchangedSourceIsFresh) {
  ASSERT_TRUE(build().ok());
  EXPECT_TRUE(check().ok());
  fs_.put("scene.bin", fs_.contents("scene.bin"));  // written again, to the same bytes
  EXPECT_TRUE(check().ok());
}

TEST_F(SourceFilesTest, SaysWhichPartChangedAndHow) {
  ASSERT_TRUE(build().ok());
  const std::map<std::string, std::string> parts = {
      {"scene.gltf", "expected "}, {"scene.bin", "expected "}, {"image0.png", "expected "}};
  for (const auto& [name, how] : parts) {
    const auto before = fs_.contents(name);
    put_longer(name);
    expect_stale(name, how + std::to_string(before.size()) + " bytes, found " + std::to_string(before.size() + 3));
    fs_.put(name, before);
    EXPECT_TRUE(check().ok());
  }
  auto json = fs_.contents("scene.gltf");
  const std::string text(reinterpret_cast<const char*>(json.data()), json.size());
  const size_t at = text.find("\"2.0\"");
  ASSERT_NE(at, std::string::npos);
  json[at + 3] = std::byte{'1'};  // as long as before
  fs_.put("scene.gltf", json);
  expect_stale("scene.gltf", "expected JSON of hash");
}

TEST_F(SourceFilesTest, ASourceThatWasMovedOrConsumedIsNotMissed) {
  ASSERT_TRUE(build().ok());
  ASSERT_TRUE(fs_.remove("scene.bin").ok());
  EXPECT_TRUE(check().ok());
  ASSERT_TRUE(fs_.remove("scene.gltf").ok());
  put_longer("image0.png");
  EXPECT_TRUE(check().ok());
}

TEST_F(SourceFilesTest, ASourceThatChangesWhileItIsBuiltIsNoticed) {
  const std::function<void()> changes[] = {
      [&] { put_longer("scene.bin"); },
      [&] { fs_.put("scene.gltf", fs_.contents("scene.gltf")); },
      [&] { fs_.put("scene.bin", std::string("short")); },
      [&] { (void)fs_.remove("image0.png"); }};
  const auto names = fs_.names();
  for (const auto& change : changes) {
    const auto report = build(change);
    ASSERT_FALSE(report.ok());
    EXPECT_EQ(report.error().code, ErrorCode::kInput);
    EXPECT_NE(report.error().message.find("changed while the scene was built"), std::string::npos)
        << report.error().message;
    EXPECT_FALSE(fs_.exists("scene.shoal"));
    save_bad_luck_scene(fs_, 50);
    EXPECT_EQ(fs_.names(), names);
  }
  EXPECT_TRUE(build().ok());
}

TEST_F(SourceFilesTest, ADamagedListSaysNothing) {
  ASSERT_TRUE(build().ok());
  auto scene = open_scene(fs_, "scene.shoal", ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  const std::string whole = scene.value().source_files;
  put_longer("scene.gltf");
  EXPECT_FALSE(check_source_is_unchanged(fs_, scene.value()).ok());
  for (const std::string& list : {std::string(), std::string("sources 2"), std::string("sources 1\0zz\0", 13),
                                  std::string("sources 1\0" "0\0" "7\0", 14), whole.substr(0, 30)}) {
    scene.value().source_files = list;
    EXPECT_TRUE(check_source_is_unchanged(fs_, scene.value()).ok()) << list;
  }
}

}  // namespace
}  // namespace shoal::testing
