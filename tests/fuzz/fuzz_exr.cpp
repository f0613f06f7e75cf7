// OpenEXR pictures from strangers: environments, and what `shoal diff` reads.
#include "io/exr_header.h"
#include "io/image.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/memory_file_system.h"

namespace shoal::fuzz {
namespace {

void read_layers(FileSystem& fs) {
  const auto image = read_exr(fs, "input.exr", kMaxPixels);
  if (!image.ok()) return;
  const uint64_t pixels = uint64_t{image.value().width} * image.value().height;
  require(pixels > 0 && pixels <= kMaxPixels);
  for (const ExrChannel& channel : image.value().channels) {
    require(channel.values.size() == pixels);
    require(channel.integers.empty() || channel.integers.size() == pixels);
  }
}

void read_environment(FileSystem& fs) {
  const auto size = hdr_image_size(fs, "input.exr", kMaxPixels);
  const auto image = read_hdr_image(fs, "input.exr", kMaxPixels);
  if (!image.ok()) return;
  require(size.ok() && size.value().width == image.value().width && size.value().height == image.value().height);
  require(image.value().rgb.size() == uint64_t{3} * image.value().width * image.value().height);
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  shoal::MemoryFileSystem fs;
  fs.put("input.exr", shoal::fuzz::bytes_of(data, size));
  shoal::fuzz::read_layers(fs);
  shoal::fuzz::read_environment(fs);
  return 0;
}
