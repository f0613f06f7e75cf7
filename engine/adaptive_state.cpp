// Adaptive sampling as checkpoints hold it.
#include <algorithm>
#include <cmath>

#include "engine/adaptive_sampling.h"

namespace shoal {

static_assert(sizeof(AdaptiveSampling::Numbers) == 32);

AdaptiveSampling::Numbers AdaptiveSampling::numbers() const {
  Numbers numbers{rendered_count_, samples_, static_cast<uint32_t>(drawn_.size()), {}, {}};
  for (int h = 0; h < 2; ++h) {
    numbers.more_of_all[h] = halves_[h].more_of_all;
    numbers.dark[h] = halves_[h].dark;
  }
  return numbers;
}

std::vector<std::span<std::byte>> AdaptiveSampling::parts() {
  std::vector<std::span<std::byte>> parts;
  const auto add = [&](auto& values) { parts.push_back(std::as_writable_bytes(std::span(values))); };
  for (Half& half : halves_) {
    add(half.sums), add(half.seen), add(half.noise), add(half.variance);
    add(half.blocks), add(half.more), add(half.judging);
  }
  add(counted_), add(drawn_);
  return parts;
}

uint64_t AdaptiveSampling::parts_bytes(uint32_t width, uint32_t height, uint32_t drawn_count) {
  const uint64_t pixels = uint64_t{width} * height;
  const uint64_t blocks = uint64_t{(width + kBlock - 1) / kBlock} * ((height + kBlock - 1) / kBlock);
  const uint64_t half = pixels * (sizeof(Sums) + 1 + 2 * sizeof(float)) + blocks * (sizeof(Moments) + sizeof(float) + 1);
  return 2 * half + blocks + uint64_t{drawn_count} * sizeof(uint32_t);
}

bool AdaptiveSampling::take(const Numbers& numbers) {
  if (numbers.drawn_count > counted_.size() || numbers.rendered_count > counted_.size()) return false;
  samples_ = numbers.samples;
  rendered_count_ = numbers.rendered_count;
  drawn_.assign(numbers.drawn_count, 0);
  for (int h = 0; h < 2; ++h) {
    halves_[h].more_of_all = numbers.more_of_all[h];
    halves_[h].dark = numbers.dark[h];
  }
  return true;
}

bool AdaptiveSampling::plausible(uint32_t samples) const {
  const auto all = [](const auto& values, const auto& good) { return std::all_of(values.begin(), values.end(), good); };
  const auto number = [](float value) { return !std::isnan(value); };
  for (const Half& half : halves_) {
    const bool good = number(half.more_of_all) && number(half.dark) && all(half.more, number) &&
                      all(half.sums, [](const Sums& sums) { return sums.sum.in_range(); }) &&
                      all(half.seen, [](uint8_t seen) { return seen <= 1; }) &&
                      all(half.judging, [](uint8_t judging) { return judging <= 1; }) &&
                      all(half.blocks, [](const Moments& m) { return !std::isnan(m.mean) && !std::isnan(m.variance); });
    if (!good) return false;
  }
  if (samples_ != samples / 2 || !all(counted_, [](uint8_t bits) { return bits <= 3; })) return false;
  // Some of all blocks, in their order.
  const std::vector<uint32_t> order = SampleOrder::blocks_in_order(width_, height_);
  auto at = order.begin();
  for (const uint32_t block : drawn_) {
    at = std::find(at, order.end(), block);
    if (at == order.end()) return false;
    ++at;
  }
  return !drawn_.empty();
}

}  // namespace shoal
