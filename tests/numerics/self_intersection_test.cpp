// No ray meets the surface that it leaves, and none passes over a neighbour that is farther than the stated bound
// (offset_reach() of engine/surface_error.h): meshes of any size, through instances, and stacks of layers.
#include <gtest/gtest.h>

#include <optional>

#include "tests/numerics/leaving_rays.h"

namespace shoal::testing {
namespace {

struct Place {
  const char* name;
  Affine3 map;
};

/// Sizes, shears and mirrors, as far from the origin as `away`.
std::vector<Place> places(float away) {
  const Vec3 far(away, -0.7f * away, 0.4f * away);
  return {{"as it is", {}},
          {"moved", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, far}},
          {"turned and stretched", {{0.6f, 0.8f, 0}, {-8, 6, 0}, {0, 0, 0.01f}, far}},
          {"sheared", {{1, 0.2f, 0}, {3, 1, -2}, {0.5f, 0, 1}, far}},
          {"mirrored", {{-0.3f, 0, 0.4f}, {0, 1.5f, 0}, {0.4f, 0.1f, 0.3f}, far}}};
}

/// How far the plane of a triangle is above a place, along `up`.
double gap_to(const WorldTriangle& t, const DVec3& from, const Vec3& up) {
  const DVec3 n = glm::cross(t.p[1] - t.p[0], t.p[2] - t.p[0]);
  const double sign = glm::dot(n, DVec3(up)) < 0 ? -1 : 1;
  return sign * glm::dot(n, t.p[0] - from) / std::sqrt(glm::dot(n, n));
}

struct Tally {
  size_t tried = 0, acne = 0, leaks = 0, close_leaks = 0, checked = 0, skipped = 0;
  size_t acne_without_offset = 0;  ///< of the same rays from the points themselves: the test sees what it looks for
};

/// From inside a closed mesh rays start in every direction, and from where they end others at grazing angles.
Tally try_mesh(float size, const Affine3& map, uint32_t seed, size_t count) {
  std::mt19937 random(seed);
  auto mesh = closed_mesh(14, 28, 0.2f);
  for (TestTriangle& t : mesh) {
    for (Vec3& p : t.p) p *= size;
  }
  const TestScene scene = make_scene({mesh}, {{0, map}}, {200, 8});
  const std::vector<WorldTriangle> world = world_triangles(scene);
  std::vector<Ray> rays;
  for (size_t i = 0; i < count; ++i) {
    const Vec3 from = map.point(random_vector(random, 0.3f * size));
    rays.push_back(make_ray(from, map.vector(random_vector(random)) * (i % 2 == 0 ? 1.0f : size)));
  }
  std::vector<Departure> departures;
  std::vector<Ray> leaving;
  std::uniform_real_distribution<double> octaves(0, 22);
  for (const Ray& ray : trace_every_way(scene, rays)) {
    if (!ray.hit.valid()) continue;  // a closed mesh is watertight: others test that
    departures.push_back(depart(surface_of(scene, ray), ray.hit, -ray.direction));
    const Departure& d = departures.back();
    leaving.push_back(make_ray(d.origin, leaving_direction(random, d.normal, std::exp2(-octaves(random)))));
  }
  const std::vector<Ray> found = trace_every_way(scene, leaving);
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  Tally tally;
  for (size_t i = 0; i < found.size(); ++i) {
    const Departure& d = departures[i];
    Ray bare = make_ray(d.point.point, leaving[i].direction);
    trace_scene(tree, scene.pages, bare, trace_treelet);
    tally.acne_without_offset += bare.hit.valid() && bare.hit.primitive == d.hit.primitive;
    ++tally.tried;
    const bool own = found[i].hit.valid() && found[i].hit.primitive == d.hit.primitive;
    tally.acne += own;
    double nearest = 1e300;
    const DVec3 start(d.point.point), origin(d.origin), direction(leaving[i].direction);
    for (const WorldTriangle& t : world) {
      if (t.primitive == d.hit.primitive) continue;
      if (!found[i].hit.valid()) nearest = std::min(nearest, distance_to(t, start));
      // Met from the surface itself, higher above it than the reach, twice for the neighbour's own error: then it must
      // lie before the ray, too, and be what is found or behind that.
      const RobustHit from_surface = robust_hit(t, start, direction), from_origin = robust_hit(t, origin, direction);
      const DVec3 met = start + direction * from_surface.t;
      if (!from_surface.inside || -gap_to(world[d.hit.primitive], met, d.normal) < 2 * d.reach) continue;
      ++tally.checked;
      const bool behind = from_origin.t <= 0;
      const bool other = found[i].hit.primitive != t.primitive && found[i].t > from_origin.t * 1.001;
      const bool missed = from_origin.inside && (!found[i].hit.valid() || other);
      tally.skipped += behind || missed;
    }
    if (!found[i].hit.valid()) ++(nearest > 2 * d.reach ? tally.leaks : tally.close_leaks);
  }
  return tally;
}

TEST(SelfIntersection, GrazingRaysLeaveMeshesOfAnySizeAndSkipNoNeighbour) {
  Tally sum;
  uint32_t seed = 1;
  for (const float size : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e6f}) {
    for (const Place& place : places(20 * size)) {
      const Tally tally = try_mesh(size, place.map, ++seed, rays_to_try(600));
      EXPECT_GT(tally.tried, 590u) << place.name << " of " << size;
      EXPECT_GT(tally.checked, 200u) << place.name << " of " << size;
      EXPECT_EQ(tally.acne, 0u) << place.name << " of " << size;
      EXPECT_EQ(tally.skipped, 0u) << place.name << " of " << size;
      EXPECT_EQ(tally.leaks, 0u) << place.name << " of " << size;
      sum.acne_without_offset += tally.acne_without_offset;
      sum.tried += tally.tried, sum.checked += tally.checked, sum.close_leaks += tally.close_leaks;
    }
  }
  EXPECT_GT(sum.acne_without_offset, sum.tried / 20) << "or these rays prove nothing";
  RecordProperty("rays", std::to_string(sum.tried));
  RecordProperty("acne_without_offset", std::to_string(sum.acne_without_offset));
  RecordProperty("left_closer_to_a_neighbour_than_the_bound", std::to_string(sum.close_leaks));
}

/// Squares one above the other at these heights, in a frame that is turned and moved.
std::vector<TestTriangle> stack(const std::vector<float>& heights, const Affine3& frame, float size) {
  std::vector<TestTriangle> layers;
  for (const float height : heights) {
    const Vec3 corner[4] = {frame.point({-size, -size, height}), frame.point({size, -size, height}),
                            frame.point({size, size, height}), frame.point({-size, size, height})};
    const auto id = static_cast<uint32_t>(layers.size());
    layers.push_back({{corner[0], corner[1], corner[2]}, id});
    layers.push_back({{corner[0], corner[2], corner[3]}, id + 1});
  }
  return layers;
}

struct LayerTally {
  size_t met = 0, passed_close = 0, passed_far = 0, went_back = 0;
};

/// One ray on its way from layer to layer.
struct Climber {
  Ray ray;
  std::optional<Departure> from;
};

/// What a climber that came from `d` to `now` passed on its way.
void count_passed(const std::vector<WorldTriangle>& world, const Departure& d, const Departure& now, const Vec3& up,
                  LayerTally& tally) {
  const uint32_t from = d.hit.primitive / 2, to = now.hit.primitive / 2;
  tally.went_back += from == to || gap_to(world[now.hit.primitive], DVec3(d.point.point), up) < -2 * d.reach;
  for (uint32_t layer = from + 1; layer < to; ++layer) {
    const double after = gap_to(world[2 * layer], DVec3(d.point.point), up);
    const double before = -gap_to(world[2 * layer], DVec3(now.point.point), up);
    ++(after > 2 * d.reach && before > 2 * now.reach ? tally.passed_far : tally.passed_close);
  }
}

/// Rays go straight on through every layer that they meet, from the lowest up.
LayerTally climb(const TestScene& scene, const Vec3& up, std::vector<Climber> climbers) {
  const std::vector<WorldTriangle> world = world_triangles(scene);
  LayerTally tally;
  while (!climbers.empty()) {
    std::vector<Ray> rays;
    for (const Climber& c : climbers) rays.push_back(c.ray);
    const std::vector<Ray> found = trace_every_way(scene, rays);
    std::vector<Climber> next;
    for (size_t i = 0; i < found.size(); ++i) {
      if (!found[i].hit.valid()) continue;
      ++tally.met;
      const Departure here = depart(surface_of(scene, found[i]), found[i].hit, rays[i].direction);
      if (climbers[i].from) count_passed(world, *climbers[i].from, here, up, tally);
      next.push_back({make_ray(here.origin, rays[i].direction), here});
    }
    climbers = std::move(next);
    if (tally.met > 100000) break;  // they go back and forth
  }
  return tally;
}

/// They start below the first layer.
std::vector<Climber> climbers_below(const Affine3& frame, const Affine3& map, const Vec3& up, float size, size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> octaves(0, 6);
  std::vector<Climber> climbers;
  for (size_t i = 0; i < count; ++i) {
    Vec3 aim = random_vector(random, 0.2f * size);
    aim.z = size;
    const Vec3 direction = leaving_direction(random, up, std::exp2(-octaves(random)));
    climbers.push_back({make_ray(map.point(frame.point(aim)) - direction * (0.2f * size), direction), {}});
  }
  return climbers;
}

/// The first at a height of `size`; gaps from a unit in the last place of it to two thousandths.
std::vector<float> layer_heights(float size) {
  std::vector<float> heights{size};
  for (float gap = std::nextafter(size, 2 * size) - size; gap < 2e-3f * size; gap *= 1.5f) {
    heights.push_back(std::max(heights.back() + gap, std::nextafter(heights.back(), 2 * size)));
  }
  return heights;
}

TEST(SelfIntersection, LayersFartherApartThanTheBoundAreNeverPassedOver) {
  size_t close = 0, met = 0;
  for (const float size : {1e-6f, 1e-2f, 1.0f, 1e3f, 1e6f}) {
    const std::vector<float> heights = layer_heights(size);
    const Affine3 flat, turned{{0.48f, 0.64f, 0.6f}, {-0.8f, 0.6f, 0}, {-0.36f, -0.48f, 0.8f}, Vec3(0.3f * size)};
    for (const Affine3& frame : {flat, turned}) {
      for (const Place& place : places(3 * size)) {
        const TestScene scene = make_scene({stack(heights, frame, size)}, {{0, place.map}}, {8, 4});
        const DVec3 a(place.map.vector(frame.column_x)), b(place.map.vector(frame.column_y));
        DVec3 up = glm::cross(a, b);
        up *= (glm::dot(up, DVec3(place.map.vector(frame.column_z))) < 0 ? -1 : 1) / std::sqrt(glm::dot(up, up));
        const LayerTally tally =
            climb(scene, Vec3(up), climbers_below(frame, place.map, Vec3(up), size, rays_to_try(40)));
        EXPECT_GE(tally.met, rays_to_try(40) * 4) << place.name << " of " << size;
        EXPECT_EQ(tally.passed_far, 0u) << place.name << " of " << size;
        EXPECT_EQ(tally.went_back, 0u) << place.name << " of " << size;
        close += tally.passed_close, met += tally.met;
      }
    }
  }
  EXPECT_GT(close, 0u) << "a unit in the last place is within the bound: some are passed";
  RecordProperty("layers_met", std::to_string(met));
  RecordProperty("layers_passed_within_the_bound", std::to_string(close));
}

}  // namespace
}  // namespace shoal::testing
