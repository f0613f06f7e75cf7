// Pictures from strangers that are not EXR: PNG, JPEG and WebP as textures, Radiance .hdr as environments.
#include "io/image.h"
#include "io/radiance_image.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/memory_file_system.h"

namespace shoal::fuzz {
namespace {

void read_texture(std::span<const std::byte> bytes) {
  const auto image = decode_image(bytes, "input", kMaxPixels);
  if (!image.ok()) {
    require(image.error().code == ErrorCode::kInput);
    return;
  }
  const uint64_t pixels = uint64_t{image.value().width} * image.value().height;
  require(pixels > 0 && pixels <= kMaxPixels);
  require(image.value().rgba.size() == 4 * pixels);
}

void read_environment(const std::vector<std::byte>& bytes) {
  MemoryFileSystem fs;
  fs.put("input.hdr", bytes);
  const auto size = hdr_image_size(fs, "input.hdr", kMaxPixels);
  const auto image = read_hdr_image(fs, "input.hdr", kMaxPixels);
  if (!image.ok()) return;
  require(size.ok() && size.value().width == image.value().width && size.value().height == image.value().height);
  require(image.value().rgb.size() == uint64_t{3} * image.value().width * image.value().height);
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::vector<std::byte> bytes = shoal::fuzz::bytes_of(data, size);
  if (shoal::is_radiance(bytes)) {
    shoal::fuzz::read_environment(bytes);
  } else {
    shoal::fuzz::read_texture(bytes);
  }
  return 0;
}
