// OpenEXR pictures in and out. The library runs without threads of its own: its caller decides about threads.
#include <ImfChannelList.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfMatrixAttribute.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <half.h>

#include <algorithm>

#include "io/exr_header.h"
#include "io/exr_stream.h"
#include "io/image.h"

namespace shoal {

namespace {

/// Rows written at once: halves are converted into a buffer of so many.
constexpr uint32_t kBandRows = 64;

Imath::Box2i box(int32_t x, int32_t y, uint32_t width, uint32_t height) {
  return {Imath::V2i(x, y), Imath::V2i(x + static_cast<int32_t>(width) - 1, y + static_cast<int32_t>(height) - 1)};
}

Imf::PixelType stored_type(const ExrChannel& channel) {
  if (!channel.integers.empty()) return Imf::UINT;
  return channel.half ? Imf::HALF : Imf::FLOAT;
}

Imf::Header make_header(const ExrImage& image) {
  const Imath::Box2i data = box(image.data_x, image.data_y, image.width, image.height);
  const bool framed = image.display_width != 0 && image.display_height != 0;
  Imf::Header header(framed ? box(0, 0, image.display_width, image.display_height) : data, data);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const ExrChannel& channel : image.channels) {
    header.channels().insert(channel.name, Imf::Channel(stored_type(channel)));
  }
  for (const auto& [name, text] : image.text) header.insert(name, Imf::StringAttribute(text));
  for (const auto& [name, number] : image.numbers) header.insert(name, Imf::FloatAttribute(number));
  for (const auto& [name, m] : image.matrices) {
    Imath::M44f matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = m[static_cast<size_t>(i)];
    header.insert(name, Imf::M44fAttribute(matrix));
  }
  return header;
}

/// Half holds up to 65504; larger finite values stay finite.
half to_half(float value) {
  constexpr float kLargestHalf = 65504.0f;
  const bool finite = value - value == 0.0f;
  return half(finite ? std::clamp(value, -kLargestHalf, kLargestHalf) : value);
}

void write_bands(Imf::OutputFile& output, const ExrImage& image) {
  const size_t width = image.width;
  std::vector<std::vector<half>> halves(image.channels.size());
  for (uint32_t first = 0; first < image.height; first += kBandRows) {
    const uint32_t rows = std::min(kBandRows, image.height - first);
    const Imath::V2i corner(image.data_x, image.data_y + static_cast<int32_t>(first));
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < image.channels.size(); ++c) {
      const ExrChannel& channel = image.channels[c];
      const Imf::PixelType type = stored_type(channel);
      const void* base = nullptr;
      if (type == Imf::UINT) {
        base = channel.integers.data() + first * width;
      } else if (type == Imf::FLOAT) {
        base = channel.values.data() + first * width;
      } else {
        const float* values = channel.values.data() + first * width;
        halves[c].resize(rows * width);
        std::transform(values, values + rows * width, halves[c].begin(), to_half);
        base = halves[c].data();
      }
      frame.insert(channel.name, Imf::Slice::Make(type, base, corner, static_cast<int64_t>(width), rows));
    }
    output.setFrameBuffer(frame);
    output.writePixels(static_cast<int>(rows));
  }
}

void read_attributes(const Imf::Header& header, ExrImage& image) {
  for (auto it = header.begin(); it != header.end(); ++it) {
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute())) {
      image.text[it.name()] = text->value();
    } else if (const auto* number = dynamic_cast<const Imf::FloatAttribute*>(&it.attribute())) {
      image.numbers[it.name()] = number->value();
    } else if (const auto* matrix = dynamic_cast<const Imf::M44fAttribute*>(&it.attribute())) {
      auto& m = image.matrices[it.name()];
      for (int i = 0; i < 16; ++i) m[static_cast<size_t>(i)] = matrix->value()[i / 4][i % 4];
    }
  }
}

ExrImage read_checked(Imf::InputFile& input) {
  const Imf::Header& header = input.header();
  const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
  ExrImage image;
  image.width = static_cast<uint32_t>(data.max.x - data.min.x) + 1;
  image.height = static_cast<uint32_t>(data.max.y - data.min.y) + 1;
  image.data_x = data.min.x - display.min.x;
  image.data_y = data.min.y - display.min.y;
  image.display_width = static_cast<uint32_t>(display.max.x - display.min.x) + 1;
  image.display_height = static_cast<uint32_t>(display.max.y - display.min.y) + 1;
  read_attributes(header, image);
  Imf::FrameBuffer frame;
  for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
    image.channels.push_back({it.name(), it.channel().type == Imf::HALF, {}});
    ExrChannel& channel = image.channels.back();
    channel.values.resize(size_t{image.width} * image.height);
    if (it.channel().type == Imf::UINT) {
      channel.integers.resize(channel.values.size());
      frame.insert(channel.name, Imf::Slice::Make(Imf::UINT, channel.integers.data(), data));
    } else {
      frame.insert(channel.name, Imf::Slice::Make(Imf::FLOAT, channel.values.data(), data));
    }
  }
  input.setFrameBuffer(frame);
  input.readPixels(data.min.y, data.max.y);
  for (ExrChannel& channel : image.channels) {
    std::transform(channel.integers.begin(), channel.integers.end(), channel.values.begin(),
                   [](uint32_t integer) { return static_cast<float>(integer); });
  }
  return image;
}

ImageF read_rgb(Imf::InputFile& input) {
  const Imf::ChannelList& channels = input.header().channels();
  const bool gray = channels.findChannel("R") == nullptr && channels.findChannel("Y") != nullptr;
  const Imath::Box2i data = input.header().dataWindow();
  ImageF image;
  image.width = static_cast<uint32_t>(data.max.x - data.min.x) + 1;
  image.height = static_cast<uint32_t>(data.max.y - data.min.y) + 1;
  image.rgb.resize(uint64_t{3} * image.width * image.height);
  Imf::FrameBuffer frame;
  constexpr size_t kStride = 3 * sizeof(float);
  for (size_t c = 0; c < (gray ? 1 : 3); ++c) {
    static constexpr const char* kNames[] = {"R", "G", "B"};
    const char* name = gray ? "Y" : kNames[c];
    if (channels.findChannel(name) == nullptr) throw Iex::ArgExc("expected channels R, G and B, or Y, found others");
    frame.insert(name, Imf::Slice::Make(Imf::FLOAT, image.rgb.data() + c, data, kStride, kStride * image.width));
  }
  input.setFrameBuffer(frame);
  input.readPixels(data.min.y, data.max.y);
  for (size_t i = 0; gray && i < image.rgb.size(); i += 3) image.rgb[i + 1] = image.rgb[i + 2] = image.rgb[i];
  return image;
}

/// `read` over the opened file; what the library throws becomes an Error.
template <class T>
Result<T> read_file(FileSystem& fs, const std::string& path, uint64_t max_pixels, T (*read)(Imf::InputFile&)) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kBuffered));
  SHOAL_RETURN_IF_ERROR(check_exr_header(*file, max_pixels));
  try {
    ExrInput stream(*file);
    Imf::InputFile input(stream, 0);
    return read(input);
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected an OpenEXR, found: {}", path, e.what())};
  }
}

}  // namespace

Status write_exr(FileSystem& fs, const std::string& path, const ExrImage& image) {
  SHOAL_CHECK(image.width > 0 && image.height > 0 && !image.channels.empty());
  for (const ExrChannel& channel : image.channels) {
    const size_t size = channel.integers.empty() ? channel.values.size() : channel.integers.size();
    SHOAL_CHECK(size == uint64_t{image.width} * image.height);
  }
  SHOAL_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(fs, path));
  ExrOutput stream(file, path);
  try {
    Imf::OutputFile output(stream, make_header(image), 0);
    write_bands(output, image);
  } catch (const std::exception& e) {
    if (!stream.status().ok()) return stream.status();
    return Error{ErrorCode::kInternal, fmt::format("{}: OpenEXR: {}", path, e.what())};
  }
  SHOAL_RETURN_IF_ERROR(stream.flush());
  return file.commit();
}

Result<ExrImage> read_exr(FileSystem& fs, const std::string& path, uint64_t max_pixels) {
  return read_file(fs, path, max_pixels, read_checked);
}

Result<ImageF> read_exr_rgb(FileSystem& fs, const std::string& path, uint64_t max_pixels) {
  return read_file(fs, path, max_pixels, read_rgb);
}

}  // namespace shoal
