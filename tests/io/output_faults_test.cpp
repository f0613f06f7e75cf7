// Whatever call of writing a picture or a report fails, the error names the file and nothing is left in the folder.
#include <gtest/gtest.h>

#include <functional>

#include "io/image.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

using Write = std::function<Status(FileSystem& fs, const std::string& path)>;

/// Harms one call after the other until the writing succeeds; says how many calls it took.
uint64_t harm_every_call(Fault fault, const std::string& path, const Write& write) {
  for (uint64_t call = 0;; ++call) {
    MemoryFileSystem memory;
    memory.put(path, "before");
    FaultyFileSystem fs(memory);
    fs.arm(fault, call);
    const Status status = write(fs, path);
    EXPECT_EQ(memory.names(), std::vector<std::string>{path}) << "call " << call;
    if (status.ok()) {
      EXPECT_LE(fs.calls(), call) << "a failed call was not noticed";
      EXPECT_GT(memory.contents(path).size(), 6u);
      return call;
    }
    EXPECT_EQ(status.error().code, ErrorCode::kStorage) << status.error().message;
    EXPECT_NE(status.error().message.find("out."), std::string::npos) << status.error().message;
    EXPECT_EQ(memory.contents(path).size(), 6u) << "what was there before is lost";
  }
}

TEST(OutputFaults, APictureOrAReportThatCannotBeWrittenLeavesWhatWasThere) {
  ExrImage image;
  image.width = 300, image.height = 200;
  image.channels.push_back({"R", false, std::vector<float>(300 * 200)});
  for (size_t i = 0; i < 300 * 200; ++i) image.channels[0].values[i] = static_cast<float>(i * 7919 % 65537);
  const auto bytes = pattern_bytes(300 * 200 * 3, 5, 0);
  std::vector<uint8_t> rgb(bytes.size());
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<uint8_t>(bytes[i]);
  const Write exr = [&](FileSystem& fs, const std::string& path) { return write_exr(fs, path, image); };
  const Write png = [&](FileSystem& fs, const std::string& path) { return write_png(fs, path, 300, 200, rgb); };
  const Write text = [&](FileSystem& fs, const std::string& path) { return write_whole_file(fs, path, bytes); };
  for (const Fault fault : {Fault::kDiskFull, Fault::kIoError}) {
    EXPECT_GE(harm_every_call(fault, "folder/out.exr", exr), 4u);  // create, write, sync, rename
    EXPECT_GE(harm_every_call(fault, "folder/out.png", png), 4u);
    EXPECT_GE(harm_every_call(fault, "folder/out.json", text), 4u);
  }
}

}  // namespace
}  // namespace shoal
