// What the samplers promise: even in every prefix, independent elsewhere, and the same whoever asks.
#include "engine/sampler.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <set>
#include <vector>

#include "engine/accuracy_names.h"
#include "engine/sobol.h"

namespace shoal {
namespace {

constexpr uint32_t kWidth = 64, kHeight = 64;
constexpr Dimension kDimensions[] = {Dimension::kPixel,   Dimension::kLens,       Dimension::kLight,  Dimension::kBsdf,
                                     Dimension::kRoulette, Dimension::kWavelength, Dimension::kTexture};
constexpr SamplerKind kStratified[] = {SamplerKind::kSobol, SamplerKind::kBlueNoise};

Sampler sampler_of(SamplerKind kind, uint32_t samples, uint64_t seed = 0) {
  return Sampler(kind, seed, kWidth, kHeight, samples);
}

/// The two numbers of a dimension that are the point of a square.
std::array<int, 2> square_of(Dimension dimension) {
  if (dimension == Dimension::kLight || dimension == Dimension::kBsdf) return {1, 2};
  return {0, 1};
}
bool has_square(Dimension d) {
  return d == Dimension::kPixel || d == Dimension::kLens || d == Dimension::kLight || d == Dimension::kBsdf;
}

/// Whether each of the equal intervals, as many as there are numbers, a power of two, holds one of them.
bool one_in_each(const std::vector<uint32_t>& bits) {
  std::set<uint64_t> seen;
  for (const uint32_t b : bits) seen.insert(uint64_t{b} * bits.size() >> 32);
  return seen.size() == bits.size();
}

/// Whether each box of area 1 / points, whose sides are powers of two, holds one of the points.
bool is_net(const std::vector<uint32_t>& a, const std::vector<uint32_t>& b) {
  for (uint64_t columns = 1; columns <= a.size(); columns *= 2) {
    const uint64_t rows = a.size() / columns;
    std::set<uint64_t> seen;
    for (size_t i = 0; i < a.size(); ++i) seen.insert((uint64_t{a[i]} * columns >> 32) * rows + (uint64_t{b[i]} * rows >> 32));
    if (seen.size() != a.size()) return false;
  }
  return true;
}

/// Pearson's statistic of counts that should be equal, in standard deviations from what is expected of it.
double chi_square_excess(const std::vector<uint32_t>& counts) {
  double total = 0, sum = 0;
  for (const uint32_t c : counts) total += c;
  const double expected = total / static_cast<double>(counts.size()), freedom = static_cast<double>(counts.size()) - 1;
  for (const uint32_t c : counts) sum += (c - expected) * (c - expected) / expected;
  return (sum - freedom) / std::sqrt(2 * freedom);
}

TEST(Sobol, DimensionsAreThoseOfJoeAndKuo) {
  // Direction numbers, from the most significant bit: the first of each dimension of new-joe-kuo-6.21201.
  const auto direction1 = [](uint32_t i) { return reversed_bits(sobol1_reversed(1u << i)); };
  const auto direction2 = [](uint32_t i) { return reversed_bits(sobol2_reversed(1u << i)); };
  const std::vector<uint32_t> expected1 = {0x80000000, 0xc0000000, 0xa0000000, 0xf0000000, 0x88000000, 0xcc000000};
  const std::vector<uint32_t> expected2 = {0x80000000, 0xc0000000, 0x60000000, 0x90000000, 0xe8000000, 0x5c000000};
  for (uint32_t i = 0; i < 6; ++i) {
    EXPECT_EQ(direction1(i), expected1[i]) << i;
    EXPECT_EQ(direction2(i), expected2[i]) << i;
  }
}

TEST(Sobol, EveryPrefixOfTheFirstTwoDimensionsIsANet) {
  for (uint32_t count = 1; count <= 4096; count *= 2) {
    for (const uint32_t first : {0u, 7 * count, 1000 * count}) {
      std::vector<uint32_t> a, b, c;
      for (uint32_t i = first; i < first + count; ++i) {
        a.push_back(reversed_bits(sobol0_reversed(i)));
        b.push_back(reversed_bits(sobol1_reversed(i)));
        c.push_back(reversed_bits(sobol2_reversed(i)));
      }
      EXPECT_TRUE(is_net(a, b)) << count << " from " << first;
      EXPECT_TRUE(one_in_each(c)) << count << " from " << first;
    }
  }
}

TEST(Sobol, AShuffledIndexStaysInItsRun) {
  for (const uint32_t key : {0u, 1u, 0x9e3779b9u, 0xffffffffu}) {
    for (uint32_t size = 1; size <= 1024; size *= 4) {
      std::set<uint32_t> seen;
      for (uint32_t i = 5 * size; i < 6 * size; ++i) seen.insert(shuffled_index(i, key));
      ASSERT_EQ(seen.size(), size);
      EXPECT_EQ(*seen.rbegin() - *seen.begin(), size - 1);
      EXPECT_EQ(*seen.begin() % size, 0u);
    }
  }
}

TEST(Sampler, EveryPrefixOfAPixelsSamplesIsEven) {
  for (const SamplerKind kind : kStratified) {
    const Sampler sampler = sampler_of(kind, 1024);
    for (const Dimension dimension : kDimensions) {
      for (const uint32_t pixel : {0u, 65u, 4095u}) {
        for (const uint32_t bounce : {0u, 3u}) {
          std::array<std::vector<uint32_t>, 3> numbers;
          for (uint32_t count = 1; count <= 1024; count *= 2) {
            for (uint32_t sample = static_cast<uint32_t>(numbers[0].size()); sample < count; ++sample) {
              const Random4 r = sampler.draw(pixel, sample, bounce, dimension);
              for (size_t i = 0; i < 3; ++i) numbers[i].push_back(r.bits[i]);
            }
            EXPECT_TRUE(one_in_each(numbers[0])) << sampler_name(kind) << static_cast<int>(dimension) << " " << count;
            if (!has_square(dimension)) continue;
            const auto [u, v] = square_of(dimension);
            EXPECT_TRUE(is_net(numbers[u], numbers[v])) << sampler_name(kind) << static_cast<int>(dimension) << " " << count;
          }
        }
      }
    }
  }
}

TEST(Sampler, BlocksOfPixelsShareANetOfTheBlueNoise) {
  // A square of 2^k x 2^k pixels at its own multiples holds a net of all their samples.
  for (const uint32_t samples : {1u, 2u, 4u, 8u}) {
    const Sampler sampler = sampler_of(SamplerKind::kBlueNoise, samples);
    for (const uint32_t side : {2u, 4u, 16u}) {
      std::vector<uint32_t> a, b;
      for (uint32_t y = 16; y < 16 + side; ++y) {
        for (uint32_t x = 32; x < 32 + side; ++x) {
          for (uint32_t s = 0; s < samples; ++s) {
            const Random4 r = sampler.draw(y * kWidth + x, s, 2, Dimension::kBsdf);
            a.push_back(r.bits[1]), b.push_back(r.bits[2]);
          }
        }
      }
      EXPECT_TRUE(is_net(a, b)) << samples << " samples, " << side << " pixels wide";
    }
  }
}

TEST(Sampler, NumbersAreEvenOverPixelsAndSeeds) {
  // One number each: no prefix helps, so this is what a hash has to do.
  for (const auto& [name, kind] : kSamplers) {
    for (const Dimension dimension : kDimensions) {
      for (int word = 0; word < (has_square(dimension) ? 3 : 1); ++word) {
        if (word == 2 && dimension != Dimension::kLight && dimension != Dimension::kBsdf) continue;
        std::vector<uint32_t> over_pixels(64), over_seeds(64);
        const Sampler one = sampler_of(kind, 1);
        for (uint32_t i = 0; i < 4096; ++i) {
          ++over_pixels[one.draw(i, 0, 1, dimension).bits[word] >> 26];
          ++over_seeds[sampler_of(kind, 1, i).draw(77, 0, 1, dimension).bits[word] >> 26];
        }
        EXPECT_LT(chi_square_excess(over_pixels), 5) << name << static_cast<int>(dimension) << word;
        EXPECT_LT(std::abs(chi_square_excess(over_seeds)), 5) << name << static_cast<int>(dimension) << word;
      }
    }
  }
}

TEST(Sampler, DimensionsBouncesAndPixelsAreIndependent) {
  struct Source {
    uint32_t pixel, bounce;
    Dimension dimension;
    int word;
  };
  const Source sources[] = {{77, 0, Dimension::kPixel, 0},  {77, 0, Dimension::kPixel, 1}, {77, 0, Dimension::kLight, 0},
                            {77, 0, Dimension::kLight, 1},  {77, 0, Dimension::kBsdf, 0},  {77, 0, Dimension::kBsdf, 1},
                            {77, 1, Dimension::kBsdf, 1},   {77, 1, Dimension::kRoulette, 0},
                            {78, 0, Dimension::kPixel, 0},  {76, 1, Dimension::kBsdf, 1}};
  for (const auto& [name, kind] : kSamplers) {
    for (size_t a = 0; a < std::size(sources); ++a) {
      for (size_t b = a + 1; b < std::size(sources); ++b) {
        // Over seeds, so that not even the order of a pixel's samples has to be independent of another's by chance.
        std::vector<uint32_t> counts(64);
        for (uint32_t seed = 0; seed < 512; ++seed) {
          const Sampler sampler = sampler_of(kind, 8, seed);
          for (uint32_t sample = 0; sample < 8; ++sample) {
            const auto bits = [&](const Source& s) { return sampler.draw(s.pixel, sample, s.bounce, s.dimension).bits[s.word]; };
            ++counts[(bits(sources[a]) >> 29) * 8 + (bits(sources[b]) >> 29)];
          }
        }
        EXPECT_LT(chi_square_excess(counts), 6) << name << " " << a << " " << b;
      }
    }
  }
}

TEST(Sampler, HalvesAreIndependentAndEachIsEven) {
  for (const SamplerKind kind : kStratified) {
    std::vector<uint32_t> together(64), apart(64);
    for (uint32_t seed = 0; seed < 2048; ++seed) {
      const Sampler halves(kind, seed, kWidth, kHeight, 16, SampleSets::kHalves), one = sampler_of(kind, 16, seed);
      const auto cell = [&](const Sampler& s, uint32_t sample) { return s.draw(99, sample, 0, Dimension::kBsdf).bits[1] >> 29; };
      ++apart[cell(halves, 4) * 8 + cell(halves, 5)];
      ++together[cell(one, 4) * 8 + cell(one, 5)];
    }
    EXPECT_LT(std::abs(chi_square_excess(apart)), 5) << sampler_name(kind);
    EXPECT_GT(chi_square_excess(together), 20) << "samples 4 and 5 of one set lie in different halves of the interval";
    const Sampler halves(kind, 7, kWidth, kHeight, 16, SampleSets::kHalves);
    for (const uint32_t half : {0u, 1u}) {
      std::vector<uint32_t> a, b;
      for (uint32_t i = 0; i < 8; ++i) {
        const Random4 r = halves.draw(99, 2 * i + half, 0, Dimension::kBsdf);
        a.push_back(r.bits[1]), b.push_back(r.bits[2]);
      }
      EXPECT_TRUE(is_net(a, b)) << sampler_name(kind) << half;
    }
  }
}

TEST(Sampler, NeighbouringSeedsShareNoNumbers) {
  for (const auto& [name, kind] : kSamplers) {
    std::set<std::array<uint32_t, 2>> seen;
    for (const uint64_t seed : {0ull, 1ull, 2ull, 3ull, 1ull << 32, (1ull << 32) + 1}) {
      const Sampler sampler = sampler_of(kind, 4, seed);
      for (uint32_t pixel = 0; pixel < 256; ++pixel) {
        for (uint32_t sample = 0; sample < 4; ++sample) {
          const Random4 r = sampler.draw(pixel, sample, 0, Dimension::kPixel);
          seen.insert({r.bits[0], r.bits[1]});
        }
      }
    }
    EXPECT_EQ(seen.size(), 6u * 256 * 4) << name;
  }
}

/// Error of the mean of a step along each pixel's samples, over a picture: where the integrand is the same everywhere.
std::vector<double> errors_of_a_step(SamplerKind kind, uint32_t samples, uint64_t seed) {
  const Sampler sampler = sampler_of(kind, samples, seed);
  std::vector<double> errors;
  for (uint32_t pixel = 0; pixel < kWidth * kHeight; ++pixel) {
    double sum = 0;
    for (uint32_t s = 0; s < samples; ++s) {
      const Random4 r = sampler.draw(pixel, s, 0, Dimension::kBsdf);
      sum += r.uniform(1) + 2 * r.uniform(2) < 1.3f ? 1 : 0;  // a slanted edge: no box of the net holds it
    }
    errors.push_back(sum / samples - 0.4);
  }
  return errors;
}

double mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return sum / static_cast<double>(values.size());
}

/// Power of the lowest eighth of frequencies in each direction but the mean, a frequency, over the mean square (white
/// noise: 1).
double low_frequency_power(const std::vector<double>& errors) {
  double power = 0, count = 0;
  for (int fy = 0; fy <= 4; ++fy) {
    for (int fx = -4; fx <= 4; ++fx) {
      if (fx == 0 && fy == 0) continue;
      std::complex<double> sum = 0;
      for (uint32_t y = 0; y < kHeight; ++y) {
        for (uint32_t x = 0; x < kWidth; ++x) {
          const double turn = (fx * static_cast<double>(x) + fy * static_cast<double>(y)) / kWidth;
          sum += errors[y * kWidth + x] * std::polar(1.0, 2 * 3.14159265358979 * turn);
        }
      }
      power += std::norm(sum), ++count;
    }
  }
  return power / count / (kWidth * kHeight) / mean_square(errors);
}

TEST(Sampler, ErrorsOfTheBlueNoiseHaveLittleLowFrequency) {
  for (const uint32_t samples : {1u, 4u, 8u}) {
    double white = 0, sobol = 0, blue = 0;
    for (uint64_t seed = 1; seed <= 4; ++seed) {
      white += low_frequency_power(errors_of_a_step(SamplerKind::kIndependent, samples, seed)) / 4;
      sobol += low_frequency_power(errors_of_a_step(SamplerKind::kSobol, samples, seed)) / 4;
      blue += low_frequency_power(errors_of_a_step(SamplerKind::kBlueNoise, samples, seed)) / 4;
    }
    EXPECT_NEAR(white, 1, 0.4) << samples;
    EXPECT_NEAR(sobol, 1, 0.4) << samples;
    EXPECT_LT(blue, 0.5) << samples;
  }
}

TEST(Sampler, EvenSamplesHaveTheMeanAndLessError) {
  for (const uint32_t samples : {16u, 64u}) {
    const auto errors = [&](SamplerKind kind) {
      std::vector<double> all;
      for (uint64_t seed = 1; seed <= 3; ++seed) {
        const std::vector<double> more = errors_of_a_step(kind, samples, seed);
        all.insert(all.end(), more.begin(), more.end());
      }
      return all;
    };
    const double white = mean_square(errors(SamplerKind::kIndependent));
    EXPECT_NEAR(white, 0.4 * 0.6 / samples, 0.05 * white);
    for (const SamplerKind kind : kStratified) {
      const std::vector<double> even = errors(kind);
      double mean = 0;
      for (const double e : even) mean += e / static_cast<double>(even.size());
      EXPECT_NEAR(mean, 0, 4 * std::sqrt(white / static_cast<double>(even.size()))) << sampler_name(kind);
      // An edge is crossed by about sqrt(n) of n cells: the variance falls as n^-1.5 (Burley 2020, section 2).
      EXPECT_LT(mean_square(even), white * 2 / std::sqrt(samples)) << sampler_name(kind);
    }
  }
}

}  // namespace
}  // namespace shoal
