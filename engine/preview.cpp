#include "engine/preview.h"

#include <algorithm>

#include "engine/clock.h"
#include "io/image.h"

namespace shoal {
namespace {

/// Chosen: often while much changes, seldom later.
constexpr double kFirstIntervalSeconds = 2, kLongestIntervalSeconds = 30;
/// Of the time of all threads, what drawing and writing may take after the first: chosen.
constexpr double kShareOfTime = 0.02;
/// What libpng and zlib hold for themselves while they write.
constexpr uint64_t kWriterBytes = 1u << 20;

}  // namespace

Preview::Preview(FileSystem& fs, const PreviewOptions& options, const Film& film, const SampleOrder& samples,
                 unsigned threads, double start_seconds, const std::function<void(const std::string&)>& warning)
    : fs_(fs),
      options_(options),
      film_(film),
      samples_(samples),
      threads_(threads),
      start_seconds_(start_seconds),
      warning_(warning),
      interval_seconds_(kFirstIntervalSeconds),
      rgb_(size_t{film.width()} * film.height() * 3),
      known_(size_t{film.width()} * film.height()),
      row_x_(film.width()) {
  for (std::vector<float>& channel : row_) channel.resize(film.width());
}

uint64_t Preview::bytes(uint32_t width, uint32_t height) {
  const uint64_t row = uint64_t{width} * (3 * sizeof(float) + sizeof(uint32_t) + 3);
  // The file grows in memory before it is written: at most as large as the pixels, and once more while it moves.
  return uint64_t{width} * height * (3 + 1 + 2 * 3) + row + kWriterBytes;
}

std::optional<FirstPicture> Preview::first() const {
  const std::lock_guard guard(first_mutex_);
  return first_;
}

void Preview::show_when_due(uint64_t samples_done) {
  if (samples_done < samples_.first_lattice_count()) return;
  if (now_seconds() < due_seconds_.load(std::memory_order_relaxed) || !mutex_.try_lock()) return;
  const std::lock_guard guard(mutex_, std::adopt_lock);
  if (now_seconds() < due_seconds_.load(std::memory_order_relaxed) || samples_done == shown_samples_) return;
  shown_samples_ = samples_done;
  show();
}

void Preview::show_if_none() {
  const std::lock_guard guard(mutex_);
  if (!first()) show();
}

void Preview::show() {
  const double start = now_seconds();
  const uint64_t known = draw();
  const Status written = write_png(fs_, options_.path, film_.width(), film_.height(), rgb_);
  const double end = now_seconds();
  seconds_ += end - start;
  due_seconds_ = end + std::max(interval_seconds_, (end - start) / (kShareOfTime * threads_));
  interval_seconds_ = std::min(2 * interval_seconds_, kLongestIntervalSeconds);
  if (!written.ok()) {
    if (!warned_ && warning_) warning_("the preview could not be written: " + written.error().message);
    warned_ = true;
    return;
  }
  ++shown_count_;
  const std::lock_guard guard(first_mutex_);
  if (first_) return;
  first_ = FirstPicture{end - start_seconds_, static_cast<double>(known) / static_cast<double>(known_.size())};
}

uint64_t Preview::draw() {
  uint64_t known = 0;
  for (uint32_t y = 0; y < film_.height(); ++y) draw_row(y, known);
  if (known == known_.size()) return known;
  for (uint32_t y = 0; y < film_.height(); ++y) fill_row(y);
  return known;
}

void Preview::draw_row(uint32_t y, uint64_t& known) {
  const uint32_t width = film_.width();
  uint32_t count = 0;
  for (uint32_t x = 0; x < width; ++x) {
    float rgb[3];
    const bool has_samples = film_.mean(y * width + x, rgb) > 0;
    known_[size_t{y} * width + x] = has_samples ? 1 : 0;
    if (!has_samples) continue;
    for (int c = 0; c < 3; ++c) row_[c][count] = rgb[c];
    row_x_[count++] = x;
  }
  known += count;
  const auto part = [&](int c) { return std::span<const float>(row_[c]).first(count); };
  const std::vector<uint8_t> mapped = tone_map_image(part(0), part(1), part(2), options_.tone);
  for (uint32_t i = 0; i < count; ++i) {
    std::copy_n(&mapped[size_t{i} * 3], 3, &rgb_[(size_t{y} * width + row_x_[i]) * 3]);
  }
}

void Preview::fill_row(uint32_t y) {
  const uint32_t width = film_.width(), height = film_.height();
  const auto nearest = [](uint32_t at, uint32_t spacing, uint32_t size) {
    return std::min((at + spacing / 2) / spacing, (size - 1) / spacing) * spacing;
  };
  for (uint32_t x = 0; x < width; ++x) {
    const size_t pixel = size_t{y} * width + x;
    if (known_[pixel] != 0) continue;
    std::fill_n(&rgb_[pixel * 3], 3, uint8_t{0});
    for (uint32_t spacing = 2; spacing <= samples_.first_spacing(); spacing *= 2) {
      const size_t from = size_t{nearest(y, spacing, height)} * width + nearest(x, spacing, width);
      if (known_[from] == 0) continue;
      std::copy_n(&rgb_[from * 3], 3, &rgb_[pixel * 3]);
      break;
    }
  }
}

}  // namespace shoal
