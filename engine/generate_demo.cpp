#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "engine/generate_fish.h"
#include "engine/generate_kinds.h"
#include "engine/generate_reef.h"
#include "engine/generate_rocks.h"
#include "engine/generate_textures.h"
#include "engine/math.h"
#include "engine/noise.h"
#include "engine/scene_composer.h"

// A shoal of fish over a reef: sand, boulders and an arch of unique triangles; instanced fish, corals and weeds;
// metal and marble balls in the foreground; sunlight through a rippled surface (an alpha-blended sheet far up), a
// glowing dome of open sea.

namespace shoal {
namespace {

// Shares of the triangles left after the models, for what is unique.
constexpr double kSandShare = 0.42, kRockShare = 0.5;  // the rest: brain corals and pebbles
constexpr double kNear = 13, kFar = -42, kHalfWidth = 34;
constexpr int kFishCount = 430;
constexpr double kSunLux = 6.5;

double sand_height(double x, double z, uint32_t seed, int octaves) {
  const double warp = 1.3 * gradient_noise(x / 4.5, 0, z / 4.5, seed + 1);
  const double side = gradient_noise(x / 7, 5, z / 7, seed + 2);
  const float phase = static_cast<float>(9.5 * (z * 0.85 + x * 0.25 + warp));
  const double crest = sin_cos(phase).sin;
  const double ripples = 0.028 * (crest + 0.25 * crest * crest) * (0.6 + 0.5 * side);
  const double dunes = 0.30 * gradient_noise(x / 9, 9, z / 9, seed + 3);
  const double banks = 2.4 * smooth_step(5, 15, std::abs(x)) *
                       (0.7 + 0.5 * gradient_noise(x / 8, 2, z / 8, seed + 4)) * smooth_step(10, -2, z);
  const double grain = 0.010 * fractal_noise(x / 0.35, 1, z / 0.35, seed + 6, octaves);
  return ripples + dunes + banks + grain - 0.9 * smooth_step(-8, -40, z);
}

struct DemoMaterials {
  uint32_t sand, rock, dark_rock, brain[2], gold, copper, silver, marble, pearl, orb, star, sea, veil;
  uint32_t fish, golden_fish, fins, golden_fins, coral[3], fan, kelp;
};

class DemoScene {
 public:
  DemoScene(const GenerateContext& context, GltfWriter& writer, GenerateReport& report)
      : context_(&context),
        writer_(&writer),
        report_(&report),
        document_(&writer.document()),
        seed_(static_cast<uint32_t>(context.options.seed ^ (context.options.seed >> 32))) {}

  Status write() {
    SHOAL_RETURN_IF_ERROR(write_textures());
    add_materials();
    add_light();
    add_fish();
    add_reef();
    add_still_life();
    add_camera(*document_, "reef", Vec3(0.2f, 1.75f, 10.6f), Vec3(0.1f, 2.2f, 0), 0.74);
    add_unique();
    report_->triangles_count += triangles_;
    return writer_->status();
  }

 private:
  Status paint(const char* name, uint32_t width, uint32_t height, const Paint& with) {
    return write_texture(*context_, name, width, height, with, *report_);
  }

  Status write_textures() {
    SHOAL_RETURN_IF_ERROR(paint("fish-color.png", 512, 256, paint_fish));
    SHOAL_RETURN_IF_ERROR(paint("fish-normal.png", 1024, 512, paint_fish_normal));
    SHOAL_RETURN_IF_ERROR(paint("fish-metal.png", 256, 128, paint_fish_metal));
    SHOAL_RETURN_IF_ERROR(paint("leaves.png", 512, 512, paint_leaves));
    const uint32_t seed = seed_;
    SHOAL_RETURN_IF_ERROR(
        paint("sea-fan.png", 1024, 1024, [seed](float u, float v) { return paint_sea_fan(u, v, seed); }));
    SHOAL_RETURN_IF_ERROR(
        paint("marble.png", 1024, 512, [seed](float u, float v) { return paint_marble(u, v, seed); }));
    SHOAL_RETURN_IF_ERROR(paint("sea.png", 512, 256, paint_sea));
    return paint("caustics.png", 1024, 1024, [seed](float u, float v) { return paint_caustics(u, v, seed); });
  }

  gltf::TextureInfo textured(const char* uri, bool clamp = false) {
    return {add_texture(*document_, uri, clamp), 0};
  }
  uint32_t material(gltf::Material of) { return add_material(*document_, std::move(of)); }

  void add_materials() {
    DemoMaterials& m = materials_;
    m.sand = material(rough_material("sand", {0.66f, 0.54f, 0.38f}));
    m.rock = material(rough_material("rock", {0.50f, 0.42f, 0.38f}, 0.85));
    m.dark_rock = material(rough_material("weathered rock", {0.34f, 0.37f, 0.36f}, 0.8));
    m.brain[0] = material(rough_material("brain coral, ochre", {0.72f, 0.42f, 0.10f}, 0.6));
    m.brain[1] = material(rough_material("brain coral, violet", {0.42f, 0.16f, 0.45f}, 0.6));
    m.gold = material(metal_material("gold", {1.0f, 0.72f, 0.32f}, 0.16));
    m.copper = material(metal_material("brushed copper", {0.95f, 0.56f, 0.40f}, 0.38));
    m.silver = material(metal_material("silver", {0.95f, 0.95f, 0.94f}, 0.04));
    gltf::Material marble = rough_material("marble", {1, 1, 1}, 0.12);
    marble.base_color_texture = textured("marble.png");
    m.marble = material(marble);
    m.pearl = material(rough_material("pearl", {0.90f, 0.84f, 0.80f}, 0.18));
    m.orb = material(emissive_material("orb", {3.4f, 0.95f, 0.16f}));
    m.star = material(rough_material("starfish", {0.86f, 0.20f, 0.06f}, 0.55));
    gltf::Material sea = emissive_material("open sea", Vec3(1.25f));
    sea.emissive_texture = textured("sea.png", true);
    m.sea = material(sea);
    gltf::Material veil = rough_material("rippled surface", Vec3(1));
    veil.alpha_mode = gltf::AlphaMode::kBlend;
    veil.base_color_texture = textured("caustics.png", true);
    m.veil = material(veil);
    add_living_materials();
  }

  void add_living_materials() {
    DemoMaterials& m = materials_;
    gltf::Material fish = rough_material("fish", {1, 1, 1});
    fish.metallic = 1;
    fish.base_color_texture = textured("fish-color.png");
    fish.normal_texture = textured("fish-normal.png");
    fish.metallic_roughness_texture = textured("fish-metal.png");
    m.fish = material(fish);
    fish.name = "golden fish", fish.base_color = {1.0, 0.52, 0.10, 1};
    m.golden_fish = material(fish);
    gltf::Material fins = metal_material("fins", {0.50f, 0.62f, 0.66f}, 0.45);
    fins.metallic = 0.4, fins.double_sided = true;
    m.fins = material(fins);
    fins.name = "golden fins", fins.base_color = {0.95, 0.42, 0.08, 1};
    m.golden_fins = material(fins);
    m.coral[0] = material(rough_material("coral, red", {0.78f, 0.14f, 0.10f}, 0.6));
    m.coral[1] = material(rough_material("coral, yellow", {0.88f, 0.58f, 0.12f}, 0.6));
    m.coral[2] = material(rough_material("coral, rose", {0.82f, 0.34f, 0.42f}, 0.6));
    gltf::Material fan = rough_material("sea fan", {1, 1, 1}, 0.7);
    fan.double_sided = true, fan.alpha_mode = gltf::AlphaMode::kMask;
    fan.base_color_texture = textured("sea-fan.png", true);
    m.fan = material(fan);
    gltf::Material kelp = fan;
    kelp.name = "kelp", kelp.base_color = {0.75, 0.85, 0.45, 1};
    kelp.base_color_texture = textured("leaves.png");
    m.kelp = material(kelp);
  }

  /// Shows a mesh of its own once.
  void show(const char* name, const MeshData& mesh, uint32_t of, const Placement& place = {}) {
    add_mesh_node(*document_, write_single_mesh(*writer_, name, mesh, of), place, name);
    count(mesh.triangles_count(), 1);
  }
  /// Counts a stored mesh that is shown `times`.
  void count(uint64_t triangles, uint64_t times) {
    triangles_ += triangles;
    report_->instanced_triangles_count += triangles * times;
    report_->instances_count += times;
  }
  void show_again(uint32_t mesh, uint64_t triangles, const Placement& place) {
    add_mesh_node(*document_, mesh, place);
    report_->instanced_triangles_count += triangles;
    ++report_->instances_count;
  }

  void add_light() {
    const Vec3 sun(-0.40f, -0.82f, -0.42f);
    show("open sea", sea_dome(42, -sun, 0.925f), materials_.sea);
    add_sun(*document_, sun, {1.0f, 0.93f, 0.80f}, kSunLux);
    // The sheet lies across the sun's way, in the gap of the dome; many cells, so that its alpha is kept in full
    // (treelets/coverage.h).
    MeshData veil = curved_card(16, 0);
    const Placement across = facing(Vec3(0, 0, -4) - sun * 44.0f, sun, Vec3(0, 1, 0), 44);
    for (Vec3& p : veil.positions) p = across.point(p - Vec3(0, 0.5f, 0));
    show("rippled surface", veil, materials_.veil);
  }

  void add_fish();
  void add_reef();
  void add_still_life();
  void add_unique();
  float floor_at(float x, float z) const { return static_cast<float>(sand_height(x, z, seed_, 2)); }

  const GenerateContext* context_;
  GltfWriter* writer_;
  GenerateReport* report_;
  gltf::Document* document_;
  uint32_t seed_;
  DemoMaterials materials_{};
  uint64_t triangles_ = 0;
};

/// The way of the shoal: from far behind the arch, through it, to the right, then across the foreground to the
/// left.
constexpr Vec3 kWay[] = {{-7.0f, 4.4f, -34},  {-4.5f, 4.2f, -25},  {-1.2f, 3.9f, -15},
                         {2.2f, 3.5f, -8.0f}, {4.7f, 3.5f, -2.6f}, {4.2f, 3.5f, 1.6f},
                         {1.7f, 3.1f, 3.6f},  {-1.0f, 2.8f, 4.4f}, {-3.4f, 2.9f, 4.3f}};
constexpr int kWayLegs = static_cast<int>(std::size(kWay)) - 3;

/// Catmull-Rom; t in [0, kWayLegs].
Vec3 way_point(float t) {
  const int k = std::min(static_cast<int>(t), kWayLegs - 1);
  const float f = t - static_cast<float>(k), f2 = f * f, f3 = f2 * f;
  const Vec3 &a = kWay[k], &b = kWay[k + 1], &c = kWay[k + 2], &d = kWay[k + 3];
  return 0.5f *
         (2.0f * b + (c - a) * f + (2.0f * a - 5.0f * b + 4.0f * c - d) * f2 + (3.0f * (b - c) + d - a) * f3);
}

void DemoScene::add_fish() {
  constexpr int kStrokes = 4;
  uint32_t meshes[kStrokes + 1];
  uint64_t fish_triangles = 0;
  for (int k = 0; k <= kStrokes; ++k) {
    const float bend = static_cast<float>(k) / kStrokes;
    const MeshData body = fish_body(48, 36, bend), fins = fish_fins(bend);
    const bool golden = k == kStrokes;
    gltf::Mesh mesh;
    mesh.name = golden ? "golden fish" : "fish";
    mesh.primitives.push_back(write_mesh(*writer_, body, golden ? materials_.golden_fish : materials_.fish));
    mesh.primitives.push_back(write_mesh(*writer_, fins, golden ? materials_.golden_fins : materials_.fins));
    meshes[k] = add_mesh(*document_, std::move(mesh));
    fish_triangles = body.triangles_count() + fins.triangles_count();
    count(fish_triangles, 0);
  }
  RandomStream random(context_->options.seed, 51);
  for (int k = 0; k < kFishCount; ++k) {
    // Even along the way with jitter; the shoal is wide in its middle and narrow at its head.
    const float part = (static_cast<float>(k) + random.uniform()) / kFishCount;
    const float t = static_cast<float>(kWayLegs) * (0.02f + 0.96f * part);
    const Vec3 forward = glm::normalize(way_point(std::min(t + 0.02f, kWayLegs - 1e-3f)) - way_point(t));
    const Vec3 right = glm::normalize(glm::cross(Vec3(0, 1, 0), forward));
    const float spread = 0.35f + 1.25f * (1 - part) * (0.55f + part);
    const float off = random.uniform();
    const Vec3 out = random.unit_vector() * (spread * off * std::sqrt(off));
    const Vec3 place = way_point(t) + right * (out.x * 1.15f) + Vec3(0, out.y * 0.85f, 0) + forward * out.z;
    const Vec3 heading = forward + random.unit_vector() * 0.12f;
    const float size = random.uniform(0.62f, 0.95f);
    show_again(meshes[random.below(kStrokes)], fish_triangles,
               facing(place, heading, Vec3(0, 1, 0) + random.unit_vector() * 0.08f, size));
  }
  show_again(meshes[kStrokes], fish_triangles,
             facing(Vec3(-0.45f, 1.95f, 4.7f), Vec3(-1, 0.03f, 0.3f), Vec3(0, 1, 0), 1.15f));
}

void DemoScene::add_reef() {
  RandomStream random(context_->options.seed, 52);
  const bool fine = context_->options.triangles > 1'000'000;
  uint32_t corals[3], fan = 0;
  uint64_t coral_triangles[3];
  for (uint32_t k = 0; k < 3; ++k) {
    const MeshData coral = branch_coral(fine ? 40000 : 4000, seed_ + 60 + k);
    corals[k] = write_single_mesh(*writer_, "branch coral", coral, materials_.coral[k]);
    coral_triangles[k] = coral.triangles_count();
    count(coral_triangles[k], 0);
  }
  const MeshData card = curved_card(12, 0.25f);
  fan = write_single_mesh(*writer_, "sea fan", card, materials_.fan);
  count(card.triangles_count(), 0);
  const MeshData weeds = kelp(7, 1, seed_ + 70);
  const uint32_t weed = write_single_mesh(*writer_, "kelp", weeds, materials_.kelp);
  count(weeds.triangles_count(), 0);

  struct Bed {
    float x, z, reach;
    int corals, fans, weeds;
    float weed_height;
  };
  constexpr Bed kBeds[] = {{-4.6f, 3.4f, 1.3f, 7, 1, 0, 0},     {4.9f, 3.6f, 1.4f, 7, 3, 0, 0},
                           {-7.2f, -1.5f, 1.8f, 8, 3, 5, 4.6f}, {7.4f, -2.5f, 2.0f, 8, 3, 5, 5.2f},
                           {-2.4f, -4.5f, 2.2f, 9, 2, 2, 2.2f}, {3.2f, -7.0f, 2.4f, 9, 2, 3, 2.8f},
                           {-11, -9, 3.0f, 10, 3, 7, 6.5f},     {11, -10, 3.0f, 10, 3, 7, 6.5f}};
  for (const Bed& bed : kBeds) {
    const auto spot = [&] {
      const Vec3 off = random.unit_vector() * bed.reach * random.uniform(0.3f, 1.0f);
      const float x = bed.x + off.x, z = bed.z + off.z;
      return Vec3(x, floor_at(x, z) - 0.03f, z);
    };
    for (int k = 0; k < bed.corals; ++k) {
      const uint32_t which = random.below(3);
      const float size = random.uniform(0.35f, 0.95f);
      show_again(corals[which], coral_triangles[which], turned(spot(), 2 * kPi * random.uniform(), Vec3(size)));
    }
    for (int k = 0; k < bed.fans; ++k) {
      const float size = random.uniform(0.7f, 1.5f);
      show_again(fan, card.triangles_count(), turned(spot(), random.uniform(-0.6f, 0.6f), Vec3(size)));
    }
    for (int k = 0; k < bed.weeds; ++k) {
      const float height = bed.weed_height * random.uniform(0.6f, 1.0f);
      show_again(weed, weeds.triangles_count(),
                 turned(spot(), 2 * kPi * random.uniform(), Vec3(1.3f, height, 1.3f)));
    }
  }
}

void DemoScene::add_still_life() {
  const bool fine = context_->options.triangles > 1'000'000;
  struct Ball {
    float x, z, radius, sunk;
    uint32_t material;
  };
  const DemoMaterials& m = materials_;
  const Ball balls[] = {{1.75f, 3.7f, 0.62f, 0.12f, m.silver}, {0.55f, 4.75f, 0.34f, 0.06f, m.gold},
                        {2.75f, 4.6f, 0.30f, 0.05f, m.copper}, {-0.85f, 3.7f, 0.46f, 0.10f, m.marble},
                        {-0.1f, 5.35f, 0.13f, 0.02f, m.pearl}, {1.45f, 5.25f, 0.16f, 0.03f, m.pearl},
                        {-1.5f, 4.75f, 0.20f, 0.03f, m.pearl}, {3.3f, 3.9f, 0.22f, 0.03f, m.gold},
                        {-2.75f, 4.3f, 0.13f, 0.03f, m.orb},   {-2.45f, 4.75f, 0.09f, 0.02f, m.orb},
                        {3.75f, 4.55f, 0.12f, 0.03f, m.orb},   {-2.2f, -2.4f, 0.2f, 0.03f, m.orb},
                        {4.4f, -1.6f, 0.2f, 0.03f, m.orb}};
  const MeshData sphere = unit_sphere(fine ? 28 : 8), star = starfish(fine ? 14 : 4);
  std::map<uint32_t, uint32_t> meshes;  // by material
  for (const Ball& b : balls) {
    if (meshes.count(b.material) == 0) {
      meshes[b.material] = write_single_mesh(*writer_, "ball", sphere, b.material);
      count(sphere.triangles_count(), 0);
    }
    const Vec3 center(b.x, floor_at(b.x, b.z) + b.radius - b.sunk, b.z);
    show_again(meshes[b.material], sphere.triangles_count(), turned(center, 0.9f * b.x, Vec3(b.radius)));
  }
  const uint32_t star_mesh = write_single_mesh(*writer_, "starfish", star, m.star);
  count(star.triangles_count(), 0);
  const auto lay = [&](float x, float z, float size, float turn) {
    show_again(star_mesh, star.triangles_count(), turned(Vec3(x, floor_at(x, z) + 0.02f, z), turn, Vec3(size)));
  };
  lay(-0.75f, 5.6f, 0.36f, 0.4f);
  lay(2.5f, 5.55f, 0.30f, 1.1f);
}

struct DemoRock {
  Rock rock;
  bool dark;
};

/// Boulders about the middle and a chain of them that makes the arch.
std::vector<DemoRock> reef_rocks(uint64_t seed) {
  RandomStream random(seed, 53);
  std::vector<DemoRock> rocks;
  const auto add = [&](const Vec3& center, const Vec3& radii, bool dark) {
    rocks.push_back({Rock{center, radii, 0, 0.9f, random.bits()}, dark});
  };
  constexpr int kStones = 15;
  for (int k = 0; k <= kStones; ++k) {
    const SinCos angle = sin_cos(kPi * static_cast<float>(k) / kStones);
    const float thick = 1.45f + 0.9f * std::abs(angle.cos) + 0.3f * random.uniform(-1, 1);
    const Vec3 at(-0.6f - 8.6f * angle.cos, -0.2f + 7.3f * angle.sin, -11.5f - 1.5f * angle.cos);
    add(at + random.unit_vector() * 0.35f, Vec3(thick * 1.2f, thick, thick * 1.25f), k % 3 == 1);
  }
  add({-6.6f, 0.5f, 0.6f}, {2.0f, 1.9f, 1.8f}, false);
  add({-8.6f, 1.4f, -2.4f}, {2.4f, 3.2f, 2.4f}, true);
  add({-5.2f, 0.1f, 2.6f}, {1.0f, 0.75f, 0.9f}, true);
  add({6.9f, 0.5f, 0.9f}, {1.9f, 1.5f, 1.7f}, true);
  add({8.9f, 1.2f, -2.2f}, {2.3f, 2.9f, 2.3f}, false);
  add({5.3f, 0.0f, 2.7f}, {0.9f, 0.6f, 0.8f}, false);
  add({-2.9f, -0.1f, -4.8f}, {1.6f, 1.0f, 1.3f}, false);
  add({3.4f, -0.2f, -7.4f}, {1.7f, 1.2f, 1.5f}, true);
  for (int k = 0; k < 26; ++k) {  // smaller ones strewn about
    const float side = random.below(2) == 0 ? -1.0f : 1.0f;
    const float x = side * random.uniform(3.4f, 14), z = random.uniform(-14, 5);
    const float size = random.uniform(0.15f, 0.6f);
    add({x, static_cast<float>(sand_height(x, z, static_cast<uint32_t>(seed), 2)) + 0.1f * size, z},
        Vec3(size, size * 0.7f, size), random.below(2) == 0);
  }
  return rocks;
}

void DemoScene::add_unique() {
  const uint64_t asked = context_->options.triangles;
  const double left = static_cast<double>(asked > triangles_ + 2000 ? asked - triangles_ : 2000);
  const uint64_t models = triangles_;
  SurfaceWriter surfaces(*writer_,
                         [&](uint64_t done) { context_->report_progress("writing", models + done, asked); });
  gltf::Mesh rocks_mesh, coral_mesh, sand_mesh;
  rocks_mesh.name = "rocks", coral_mesh.name = "brain corals", sand_mesh.name = "sand";

  const std::vector<DemoRock> rocks = reef_rocks(seed_);
  double total = 0;
  const auto area = [](const Rock& rock) { return rock.radii.x * rock.radii.y; };
  for (const DemoRock& r : rocks) total += area(r.rock);
  for (const DemoRock& r : rocks) {
    const uint32_t cells = sphere_cells(kRockShare * left * area(r.rock) / total);
    surfaces.add_sphere(rocks_mesh, cells, rock_surface(r.rock, cells),
                        r.dark ? materials_.dark_rock : materials_.rock);
  }
  struct Brain {
    float x, z, radius;
    int color;
  };
  constexpr Brain kBrains[] = {{-3.3f, 3.5f, 0.62f, 0}, {-4.9f, 4.6f, 0.42f, 1}, {4.2f, 4.2f, 0.5f, 1},
                               {3.1f, 2.4f, 0.72f, 0},  {-1.4f, -1.6f, 0.6f, 1}, {1.2f, -3.4f, 0.8f, 0}};
  for (const Brain& b : kBrains) {
    const uint32_t cells = sphere_cells((1 - kSandShare - kRockShare) * left / std::size(kBrains));
    const Vec3 center(b.x, floor_at(b.x, b.z) + 0.15f * b.radius, b.z);
    surfaces.add_sphere(coral_mesh, cells,
                        brain_coral(center, Vec3(b.radius, 0.8f * b.radius, b.radius), seed_ + 80, cells),
                        materials_.brain[b.color]);
  }

  const uint64_t done = models + surfaces.triangles_count();
  const GridSize grid = grid_of((asked > done + 200 ? asked - done : 200) / 2, 1.1);
  const int octaves = octaves_down_to(0.35, 30.0 / static_cast<double>(grid.columns));
  surfaces.add_grid(
      sand_mesh, grid,
      [&](uint64_t i, uint64_t j) {
        // Finer towards the camera: squares in both directions.
        const double u = 2 * static_cast<double>(i) / static_cast<double>(grid.columns) - 1;
        const double t = static_cast<double>(j) / static_cast<double>(grid.rows);
        const double x = kHalfWidth * u * (0.3 + 0.7 * u * u), z = kNear + (kFar - kNear) * t * (0.35 + 0.65 * t);
        return Vec3(x, sand_height(x, z, seed_, octaves), z);
      },
      materials_.sand);
  for (gltf::Mesh* mesh : {&rocks_mesh, &coral_mesh, &sand_mesh}) {
    const std::string name = mesh->name;
    add_mesh_node(*document_, add_mesh(*document_, std::move(*mesh)), {}, name);
  }
  count(surfaces.triangles_count(), 1);
  report_->instances_count += 2;
}

}  // namespace

Status generate_demo(const GenerateContext& context, GltfWriter& writer, GenerateReport& report) {
  return DemoScene(context, writer, report).write();
}

}  // namespace shoal
