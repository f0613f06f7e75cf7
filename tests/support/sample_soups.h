// Triangle soups for tests: friendly, degenerate and hostile ones. Pure functions of their arguments.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "treelets/triangle_soup.h"

namespace shoal::testing {

/// A small generator with the same numbers everywhere (splitmix64).
class Numbers {
 public:
  explicit Numbers(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15ull;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ z >> 27) * 0x94d049bb133111ebull;
    return z ^ z >> 31;
  }
  uint32_t below(uint32_t n) { return static_cast<uint32_t>(next() % n); }
  float uniform(float lo, float hi) { return lo + (hi - lo) * static_cast<float>(next() >> 40) * 0x1p-24f; }

 private:
  uint64_t state_;
};

inline void add_triangle(TriangleSoup& soup, const Vec3& a, const Vec3& b, const Vec3& c, uint32_t material = 0) {
  for (const Vec3& p : {a, b, c}) soup.positions.insert(soup.positions.end(), {p.x, p.y, p.z});
  soup.primitive.push_back(static_cast<uint32_t>(1000 + soup.size()));
  soup.material.push_back(material);
}

/// Triangles of about `size` anywhere in the unit cube.
inline TriangleSoup random_soup(uint32_t count, float size, uint64_t seed = 1) {
  TriangleSoup soup;
  Numbers numbers(seed);
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 center(numbers.uniform(0, 1), numbers.uniform(0, 1), numbers.uniform(0, 1));
    const auto corner = [&] {
      return center + size * Vec3(numbers.uniform(-1, 1), numbers.uniform(-1, 1), numbers.uniform(-1, 1));
    };
    const Vec3 a = corner(), b = corner(), c = corner();
    add_triangle(soup, a, b, c, i % 3);
  }
  return soup;
}

/// A wavy height field of 2 * side * side triangles that share vertices.
inline TriangleSoup grid_soup(uint32_t side) {
  TriangleSoup soup;
  const auto point = [side](uint32_t x, uint32_t y) {
    const float fx = static_cast<float>(x) / static_cast<float>(side),
                fy = static_cast<float>(y) / static_cast<float>(side);
    return Vec3(fx, 0.3f * fx * (1 - fx) * fy + 0.01f * static_cast<float>((x * 7 + y * 13) % 5), fy);
  };
  for (uint32_t y = 0; y < side; ++y) {
    for (uint32_t x = 0; x < side; ++x) {
      add_triangle(soup, point(x, y), point(x + 1, y), point(x + 1, y + 1));
      add_triangle(soup, point(x, y), point(x + 1, y + 1), point(x, y + 1));
    }
  }
  return soup;
}

/// Gives every corner attributes; a share of corners are equal to others.
inline void add_attributes(TriangleSoup& soup, const CornerLayout& layout, uint64_t seed = 7) {
  Numbers numbers(seed);
  soup.layout = layout;
  soup.corners.clear();
  std::vector<float> pool(size_t{64} * layout.floats());
  for (float& value : pool) value = numbers.uniform(-2, 2);
  for (size_t i = 0; i < 3 * soup.size(); ++i) {
    const size_t from = size_t{numbers.below(64)} * layout.floats();
    for (uint32_t k = 0; k < layout.floats(); ++k) soup.corners.push_back(pool[from + k]);
  }
}

struct NamedSoup {
  std::string name;
  TriangleSoup soup;
};

/// Geometry that breaks careless builders. Every triangle of it is stored.
inline std::vector<NamedSoup> hostile_soups(uint32_t count) {
  const float largest = 0x1p125f, tiny = std::numeric_limits<float>::denorm_min();
  std::vector<NamedSoup> soups;
  const auto make = [&](const std::string& name, auto add) {
    TriangleSoup soup;
    for (uint32_t i = 0; i < count; ++i) add(soup, static_cast<float>(i), i);
    soups.push_back({name, std::move(soup)});
  };
  make("copies of one triangle", [](TriangleSoup& s, float, uint32_t) {
    add_triangle(s, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  });
  make("one centroid, many sizes", [](TriangleSoup& s, float f, uint32_t) {
    const float r = 1 + f;
    add_triangle(s, {-r, -r, -r}, {r, r, r}, {-r, r, 0});
  });
  make("slivers on a line", [](TriangleSoup& s, float f, uint32_t) {
    add_triangle(s, {f, 0, 0}, {f + 1, 0, 0}, {f + 2, 0, 0});
  });
  make("huge beside tiny", [](TriangleSoup& s, float f, uint32_t i) {
    const float r = i % 2 == 0 ? 1e30f : 1e-30f;
    add_triangle(s, {r * f, r, 0}, {r * (f + 1), 0, r}, {0, r * f, r});
  });
  make("powers of two", [](TriangleSoup& s, float, uint32_t i) {
    const float r = std::ldexp(1.0f, static_cast<int>(i % 250) - 125);
    add_triangle(s, {r, 0, 0}, {r, r, 0}, {r, 0, r});
  });
  make("as far out as can be", [=](TriangleSoup& s, float, uint32_t i) {
    const float sign = i % 2 == 0 ? 1.0f : -1.0f;
    add_triangle(s, {sign * largest, -largest, 0}, {-largest, largest, sign * largest}, {0, sign, largest});
  });
  make("denormals", [=](TriangleSoup& s, float f, uint32_t) {
    add_triangle(s, {tiny * f, 0, 0}, {tiny * (f + 1), tiny, 0}, {0, tiny, tiny * (f + 2)});
  });
  make("zeros of both signs", [](TriangleSoup& s, float, uint32_t i) {
    const float z = i % 2 == 0 ? 0.0f : -0.0f;
    add_triangle(s, {z, -z, z}, {1, z, -z}, {-z, 1, static_cast<float>(i % 3)});
  });
  make("far from the origin", [](TriangleSoup& s, float, uint32_t i) {
    const float x = 16777216.0f + static_cast<float>(2 * (i % 100));
    add_triangle(s, {x, x, x}, {x + 2, x, x}, {x, x + 2, x + 4});
  });
  return soups;
}

}  // namespace shoal::testing
