// Whatever call of the file layer fails while a batch runs: it goes on or ends with the right code, leaves no half
// file and no temporary, vouches for no picture that is not there, and the next batch makes up for it.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "engine/batch_run.h"
#include "io/image.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

namespace stdfs = std::filesystem;

void put(const std::string& path, const std::string& text) {
  stdfs::create_directories(stdfs::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string text_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Stands in for `shoal render`: writes what one writes, at once. The batch knows no difference.
constexpr const char* kRenderer = R"(#!/bin/sh
here=$(dirname "$0")
while [ $# -gt 0 ]; do
  case $1 in
    -o) cp "$here/picture.exr" "$2"; shift ;;
    --png) cp "$here/picture.png" "$2"; shift ;;
    --stats) cp "$here/stats.json" "$2"; shift ;;
  esac
  shift
done
)";

constexpr const char* kStats = R"({"render_seconds": 1, "memory": {"peak_rss_bytes": 1},
  "counters": {"totals": {"disk_read_bytes": 1, "rays_traced_count": 1}}, "effects": [],
  "scene": {"triangles_count": 1},
  "options": {"width": 4, "height": 4, "samples_per_pixel": 1, "order": "queued"}})";

class BadLuckBatch : public ::testing::Test {
 protected:
  void SetUp() override {
    put(folder_ / "bin/shoal", kRenderer);
    ASSERT_EQ(::chmod((folder_ / "bin/shoal").c_str(), 0755), 0);
    put(folder_ / "bin/picture.exr", "a picture");
    put(folder_ / "bin/stats.json", kStats);
    const std::vector<uint8_t> rgb(48, 100);
    ASSERT_TRUE(write_png(posix_file_system(), folder_ / "bin/picture.png", 4, 4, rgb).ok());
    put(folder_ / "scenes/a.gltf",
        R"({"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 4}]})");
    put(folder_ / "scenes/a.bin", "abcd");
    put(folder_ / "scenes/deep/b.shoal", "not looked into");
    options_.folder = folder_ / "scenes";
    options_.out = folder_ / "out";
    options_.program = folder_ / "bin/shoal";
    options_.threads = 1;
  }

  Result<BatchResult> run(FileSystem& fs) {
    SHOAL_ASSIGN_OR_RETURN(const BatchPlan plan, plan_batch(fs, options_, {}));
    return run_batch(fs, options_, {}, plan, {});
  }

  /// What must hold whenever no batch is at work.
  void expect_whole_files(const std::string& when) {
    std::error_code error;
    for (stdfs::recursive_directory_iterator at(options_.out, error), end; !error && at != end;
         at.increment(error)) {
      const std::string path = at->path().string(), name = at->path().filename().string();
      EXPECT_EQ(name.find(".tmp-"), std::string::npos) << when << " left " << path;
      EXPECT_TRUE(!path.ends_with(".json") || nlohmann::json::accept(text_of(path))) << when << ": " << path;
      if (path.find("/records/") == std::string::npos) continue;
      const auto record = read_record(posix_file_system(), path);
      ASSERT_TRUE(record.has_value()) << when << ": " << path;
      if (record->state != SceneState::kDone) continue;
      const std::string output = options_.out + "/" + record->output;
      EXPECT_EQ(text_of(output + ".exr"), "a picture") << when;
      EXPECT_EQ(text_of(output + ".stats.json"), kStats) << when;
    }
  }

  /// Harms every call in turn until none is left to harm; how many there were.
  uint64_t harm_every_call(Fault fault) {
    FaultyFileSystem fs(posix_file_system());
    for (uint64_t call = 0;; ++call) {
      const std::string when =
          "fault " + std::to_string(static_cast<int>(fault)) + " at call " + std::to_string(call);
      stdfs::remove_all(options_.out);
      fs.arm(fault, call);
      const auto harmed = run(fs);
      const bool reached = fs.calls() > call;
      if (!harmed.ok()) {
        EXPECT_EQ(harmed.error().code, ErrorCode::kStorage) << when << ": " << harmed.error().message;
        EXPECT_NE(harmed.error().message.find(folder_.path()), std::string::npos) << harmed.error().message;
      }
      expect_whole_files(when);
      if (!reached) {
        EXPECT_TRUE(harmed.ok() && harmed.value().counts.done == 2) << when;
        return call;
      }
      fs.arm(Fault::kNone, 0);
      const auto next = run(fs);
      EXPECT_TRUE(next.ok() && next.value().counts.done + next.value().counts.skipped == 2) << when;
      expect_whole_files(when + ", then another batch");
      for (const char* picture : {"/a.exr", "/deep/b.exr"})
        EXPECT_EQ(text_of(options_.out + picture), "a picture") << when;
      if (HasFailure()) return call;
    }
  }

  const TemporaryFolder folder_;
  BatchOptions options_;
};

TEST_F(BadLuckBatch, ADiskThatFailsAtAnyCallLosesNothing) { EXPECT_GE(harm_every_call(Fault::kIoError), 60u); }

TEST_F(BadLuckBatch, ADiskThatIsFullAtAnyCallLosesNothing) { EXPECT_GE(harm_every_call(Fault::kDiskFull), 30u); }

TEST_F(BadLuckBatch, AReadCutShortAtAnyCallLosesNothing) { EXPECT_GE(harm_every_call(Fault::kShortRead), 4u); }

TEST_F(BadLuckBatch, ADiskThatStaysFullEndsItAndKeepsThePicturesThatWereThere) {
  ASSERT_TRUE(run(posix_file_system()).ok());
  options_.force = true;
  FaultyFileSystem fs(posix_file_system());
  for (uint64_t call = 0; call < 12; ++call) {
    fs.arm(Fault::kDiskFull, call, true);
    const auto result = run(fs);
    ASSERT_FALSE(result.ok()) << call;
    EXPECT_EQ(result.error().code, ErrorCode::kStorage);
    expect_whole_files("disk full from call " + std::to_string(call));
    for (const char* picture : {"/a.exr", "/deep/b.exr"}) EXPECT_EQ(text_of(options_.out + picture), "a picture");
  }
}

}  // namespace
}  // namespace shoal::testing
