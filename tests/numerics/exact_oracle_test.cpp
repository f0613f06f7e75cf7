// Against exact arithmetic: which triangle a ray meets first, for rays at random and rays of every awkward sort. What the
// triangle test says may differ only within the bounds of docs/numerics.md.
#include "tests/numerics/exact_oracle.h"

#include <gtest/gtest.h>

#include "tests/numerics/every_kernel.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

TEST(ExactNumber, AgreesWithIntegers) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const auto pick = [&] { return static_cast<int64_t>(random()) >> (20 + random() % 40); };
    const int64_t a = pick(), b = pick(), c = pick();
    const Exact x(static_cast<double>(a)), y(static_cast<double>(b)), z(static_cast<double>(c));
    const __int128 value = __int128{a} * b - __int128{b} * c + a;
    EXPECT_EQ((x * y - y * z + x).sign(), value < 0 ? -1 : value > 0 ? 1 : 0);
    EXPECT_EQ(compare((x + y) * z, x * z + y * z), 0);
    EXPECT_EQ((x - x).sign(), 0);
    EXPECT_DOUBLE_EQ((x * y).to_double(), static_cast<double>(a) * static_cast<double>(b));
  }
}

TEST(ExactNumber, SeesWhatDoublesLose) {
  const Exact large(0x1p120), small(0x1p-149);
  EXPECT_EQ((large + small - large).to_double(), 0x1p-149);
  EXPECT_EQ(((large + small) * (large - small) - large * large + small * small).sign(), 0);
  EXPECT_EQ(compare(large * large * large + small, large * large * large), 1);
}

/// Counts of what the oracle and the engine said.
struct Agreement {
  size_t rays = 0, hits = 0, misses = 0;
  size_t other_side = 0;   ///< hit and miss differ, or another triangle: within the bounds
  double worst_t = 0;      ///< error of t in units of its bound
  double worst_border = 0; ///< distance to the border in units of its bound where hit and miss differ
};

class Oracle {
 public:
  Oracle(const std::vector<TestTriangle>& triangles, TriangleTest test) : triangles_(triangles), test_(test) {
    largest_ = max_abs_of(bounds_of(triangles));
  }

  /// Compares the end of a closest-hit ray, `begun` in the triangles' space.
  void judge(const Ray& begun, const Ray& found, Agreement& sum) const {
    const RaySpace space = space_of(begun);
    ++sum.rays;
    ++(found.hit.valid() ? sum.hits : sum.misses);
    double found_bound = 0;
    if (found.hit.valid()) {
      const TestTriangle& triangle = triangles_[found.hit.primitive];
      const SeenTriangle seen(space, triangle.p, largest_, test_);
      const ExactHit exact = meet_exactly(begun.origin, begun.direction, triangle.p);
      if (!exact.met) {
        ++sum.other_side;
        sum.worst_border = std::max(sum.worst_border, seen.distance_to_border() / seen.border_bound());
        ASSERT_LE(seen.distance_to_border(), seen.border_bound()) << "a hit that is none";
      } else {
        found_bound = seen.t_bound(exact.t());
        sum.worst_t = std::max(sum.worst_t, std::abs(found.t - exact.t()) / found_bound);
        ASSERT_LE(std::abs(found.t - exact.t()), found_bound) << "t is wrong, exactly " << exact.t();
      }
    }
    for (const TestTriangle& triangle : triangles_) {
      const ExactHit exact = meet_exactly(begun.origin, begun.direction, triangle.p);
      if (!exact.met) continue;
      const double t = exact.t();
      const SeenTriangle seen(space, triangle.p, largest_, test_);
      const double bound = seen.t_bound(t);
      if (t <= bound || t >= begun.t - bound || t >= found.t - bound - found_bound) continue;
      ++sum.other_side;
      sum.worst_border = std::max(sum.worst_border, seen.distance_to_border() / seen.border_bound());
      ASSERT_LE(seen.distance_to_border(), seen.border_bound())
          << "triangle " << triangle.primitive << " is passed by at t " << t << ", before " << found.t;
    }
  }

 private:
  RaySpace space_of(const Ray& ray) const {
    RaySpace space = prepare_ray(ray.origin, ray.direction);
    set_pad(space, object_pad(space, largest_), max_abs(space.origin) + largest_);
    return space;
  }

  const std::vector<TestTriangle>& triangles_;
  const TriangleTest test_;
  float largest_;
};

float next_to(float x, std::mt19937& random) {
  const float way = random() % 2 != 0 ? std::numeric_limits<float>::infinity() : -std::numeric_limits<float>::infinity();
  return std::nextafter(x, way);
}

/// Closest-hit rays at triangles about [-1, 1]^3: every fourth at random, others at, or an ulp beside, corners and edges,
/// along axes, in planes, from surfaces, from afar.
std::vector<Ray> sly_rays(const std::vector<TestTriangle>& triangles, std::mt19937& random, size_t count) {
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<Ray> rays;
  while (rays.size() < count) {
    const TestTriangle& aim = triangles[random() % triangles.size()];
    Vec3 origin = random_vector(random, 2), target = random_vector(random);
    const float along = uniform(random);
    switch (rays.size() % 8) {
      case 1:
        target = aim.p[random() % 3];
        break;
      case 2:
        target = aim.p[0] + (aim.p[1] - aim.p[0]) * along;
        break;
      case 3:
        target = aim.p[2] + (aim.p[1] - aim.p[2]) * along;
        for (int axis = 0; axis < 3; ++axis) target[axis] = next_to(target[axis], random);
        break;
      case 5: {
        const int axis = static_cast<int>(random() % 3);
        target = origin = aim.p[random() % 3];
        origin[axis] = random() % 2 != 0 ? 3.0f : -3.0f;
        break;
      }
      case 6:
        origin = aim.p[0] + (aim.p[0] - aim.p[1]) * 2.0f;
        target = aim.p[2] + (aim.p[1] - aim.p[2]) * along;
        break;
      case 7:
        origin = random() % 2 != 0 ? aim.p[0] : origin * 1000.0f;
        break;
    }
    rays.push_back(make_ray(origin, target - origin));
  }
  return rays;
}

/// The triangles as one instance under `map`; the oracle has the ray that it sees, rounded in its space.
Agreement compare_with_exact(const std::vector<TestTriangle>& triangles, const std::vector<Ray>& rays,
                             TriangleTest test, const Affine3& map = {}) {
  const TestScene scene = make_scene({triangles}, {{0, map}}, {8, 4});
  const std::vector<Ray> found = trace_every_way(scene, rays, test);
  const Oracle oracle(triangles, test);
  Agreement sum;
  for (size_t i = 0; i < rays.size() && !::testing::Test::HasFatalFailure(); ++i) {
    SCOPED_TRACE("ray " + std::to_string(i));
    Ray seen = rays[i];
    if (map != Affine3{}) {
      seen.origin = scene.instances[0].world_to_object.point(seen.origin);
      seen.direction = scene.instances[0].world_to_object.vector(seen.direction);
    }
    oracle.judge(seen, found[i], sum);
  }
  return sum;
}

void add(Agreement& sum, const Agreement& part) {
  sum.rays += part.rays, sum.hits += part.hits, sum.misses += part.misses, sum.other_side += part.other_side;
  sum.worst_t = std::max(sum.worst_t, part.worst_t), sum.worst_border = std::max(sum.worst_border, part.worst_border);
}

/// `change` alters a soup and its rays together.
template <class Change>
void expect_within_bounds(const char* name, TriangleTest test, size_t count, const Change& change,
                          const Affine3& map = {}) {
  std::mt19937 random(7);
  Agreement sum;
  for (size_t done = 0; done < count && !::testing::Test::HasFatalFailure(); done += 500) {
    auto soup = done % 1000 == 0 ? random_soup(random, 24, 0.7f) : closed_mesh(4, 6, 0.1f);
    auto rays = sly_rays(soup, random, 500);
    change(soup, rays, random);
    add(sum, compare_with_exact(soup, rays, test, map));
  }
  EXPECT_GT(sum.hits, sum.rays / 8);
  EXPECT_GT(sum.misses, sum.rays / 100);
  std::printf("[numerics] exact, %s, %s: %zu rays, %zu hits, %zu within the bound on the other side; t off by at most "
              "%.3f, borders by %.3f of their bounds\n",
              name, std::string(triangle_test_name(test)).c_str(), sum.rays, sum.hits, sum.other_side, sum.worst_t,
              sum.worst_border);
}

constexpr TriangleTest kBounded[] = {TriangleTest::kWatertight, TriangleTest::kDouble};

TEST(AgainstExact, HitMissAndOrderStayWithinTheBounds) {
  for (const TriangleTest test : kBounded) {
    expect_within_bounds("as they are", test, rays_to_try(10000),
                         [](std::vector<TestTriangle>&, std::vector<Ray>&, std::mt19937&) {});
  }
}

TEST(AgainstExact, WhateverTheScale) {
  for (const TriangleTest test : kBounded) {
    for (const int power : {-60, -25, 25, 60}) {
      const auto scale = [power](std::vector<TestTriangle>& soup, std::vector<Ray>& rays, std::mt19937&) {
        const float by = std::ldexp(1.0f, power);
        for (TestTriangle& t : soup) {
          for (Vec3& p : t.p) p *= by;
        }
        for (Ray& ray : rays) ray.origin *= by;
      };
      expect_within_bounds(("times 2^" + std::to_string(power)).c_str(), test, rays_to_try(2000), scale);
    }
  }
}

TEST(AgainstExact, WhateverTheLengthOfDirections) {
  for (const TriangleTest test : kBounded) {
    for (const int power : {-125, -110, -90, -60, 60, 110}) {
      const auto stretch = [power](std::vector<TestTriangle>&, std::vector<Ray>& rays, std::mt19937&) {
        for (Ray& ray : rays) ray.direction *= std::ldexp(1.0f, power);
      };
      expect_within_bounds(("directions times 2^" + std::to_string(power)).c_str(), test, rays_to_try(2000), stretch);
    }
  }
}

TEST(AgainstExact, AsAnInstance) {
  const std::pair<const char*, Affine3> maps[] = {
      {"scaled by 1e-3 to 1e3", {{1000, 0, 0}, {0, 1, 0}, {0, 0, 1e-3f}, {-3, 0, 100}}},
      {"sheared and mirrored", {{-1, 0, 0}, {30, 1, 0}, {-7, 20, 1}, {1, 1, 1}}},
      {"turned", {{0.3f, 0.5f, -0.7f}, {0.6f, -0.8f, 0.2f}, {-0.4f, 0.1f, 0.9f}, {0.1f, -20, 3}}}};
  for (const TriangleTest test : kBounded) {
    for (const auto& [name, map] : maps) {
      const auto place = [&to_world = map](std::vector<TestTriangle>&, std::vector<Ray>& rays, std::mt19937&) {
        for (Ray& ray : rays) {
          const Vec3 target = to_world.point(ray.origin + ray.direction);
          ray.origin = to_world.point(ray.origin);
          ray.direction = target - ray.origin;
        }
      };
      expect_within_bounds(name, test, rays_to_try(2000), place, map);
    }
  }
}

TEST(AgainstExact, SliversAndFarAway) {
  for (const TriangleTest test : kBounded) {
    expect_within_bounds("slivers of 1 to 1e7", test, rays_to_try(4000),
                         [](std::vector<TestTriangle>& soup, std::vector<Ray>& rays, std::mt19937& random) {
                           for (TestTriangle& t : soup) t.p[2] = t.p[1] + (t.p[2] - t.p[1]) * 1e-7f;
                           std::uniform_real_distribution<float> uniform(0, 1);
                           for (Ray& ray : rays) {
                             const TestTriangle& aim = soup[random() % soup.size()];
                             ray.direction = aim.p[0] + (aim.p[1] - aim.p[0]) * uniform(random) - ray.origin;
                           }
                         });
    expect_within_bounds("1e7 away", test, rays_to_try(4000),
                         [](std::vector<TestTriangle>& soup, std::vector<Ray>& rays, std::mt19937&) {
                           const Vec3 shift(1e7f, -1e7f, 1e7f);
                           for (TestTriangle& t : soup) {
                             for (Vec3& p : t.p) p = p * 1000.0f + shift;
                           }
                           for (Ray& ray : rays) {
                             const Vec3 target = (ray.origin + ray.direction) * 1000.0f + shift;
                             ray.origin = ray.origin * 1000.0f + shift;
                             ray.direction = target - ray.origin;
                           }
                         });
  }
}

/// Copies of every triangle, `turned`: with their corners in other orders. Returns the rays that did not end on the first.
size_t hits_of_copies(TriangleTest test, bool turned, size_t& hits) {
  std::mt19937 random(3);
  size_t others = 0;
  for (int round = 0; round < 20; ++round) {
    const auto original = random_soup(random, 30, 0.6f);
    std::vector<TestTriangle> soup;
    for (uint32_t copy = 0; copy < 4; ++copy) {
      for (TestTriangle t : original) {
        t.primitive += 30 * copy;
        if (turned) std::rotate(t.p, t.p + copy % 3, t.p + 3);
        if (turned && copy == 3) std::swap(t.p[0], t.p[1]);
        soup.push_back(t);
      }
    }
    std::shuffle(soup.begin(), soup.end(), random);
    const TestScene scene = make_scene({soup}, {{0, {}}}, {20, 3});
    for (const Ray& ray : trace_every_way(scene, sly_rays(original, random, 300), test)) {
      if (!ray.hit.valid()) continue;
      ++hits;
      others += ray.hit.primitive < 30 ? 0 : 1;
    }
  }
  return others;
}

TEST(AgainstExact, DuplicatesResolveToTheSmallestId) {
  for (const TriangleTest test : {TriangleTest::kFast, TriangleTest::kWatertight, TriangleTest::kDouble}) {
    size_t hits = 0, turned_hits = 0;
    EXPECT_EQ(hits_of_copies(test, false, hits), 0u);
    EXPECT_GT(hits, 2000u);
    // With corners in another order sums of three may differ in their last bit, in double seldom so that t does.
    const size_t others = hits_of_copies(test, true, turned_hits);
    EXPECT_LE(others, test == TriangleTest::kFast ? turned_hits : turned_hits / 1000);
    std::printf("[numerics] copies with their corners in another order, %s: %zu hits, %zu on a copy\n",
                std::string(triangle_test_name(test)).c_str(), turned_hits, others);
  }
}

}  // namespace
}  // namespace shoal::testing
