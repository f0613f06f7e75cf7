#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/generate_kinds.h"
#include "engine/generate_rocks.h"
#include "engine/generate_surfaces.h"
#include "engine/math.h"
#include "engine/noise.h"
#include "engine/scene_composer.h"

namespace shoal {
namespace {

// A cave along -z, in metres: a ground, an arch that makes walls and ceiling, and closed ends.
constexpr double kNear = 16, kFar = -84;
constexpr double kLength = kNear - kFar;
constexpr double kArchOverlap = 0.35;  // radians by which the arch goes below the horizon, under the ground

/// The shape of the cave as functions of place; the finest octave follows the cell size.
class Cave {
 public:
  Cave(uint32_t seed, double cell) : seed_(seed), octaves_(octaves_down_to(8, cell)) {}

  double center(double z) const { return 9 * gradient_noise(z / 48, 0, 0, seed_); }
  double half_width(double z) const { return 15 + 4 * gradient_noise(z / 31, 7, 0, seed_); }
  double height(double z) const { return 11 + 3 * gradient_noise(z / 27, 13, 0, seed_); }
  /// 1 along the cave, towards 0 at both ends, which so are closed.
  double taper(double z) const {
    const double inside = std::min(kNear - z, z - kFar) / 14;
    return std::max(0.01, std::sqrt(smooth_step(0, 1, inside)));
  }

  double ground(double x, double z) const {
    const double u = std::abs(x - center(z)) / half_width(z);
    const double path = smooth_step(0.05, 0.4, u);  // the way through is smoother
    const double rough = ridged_noise(x / 6, 3, z / 6, seed_ + 11, octaves_) * (0.12 + 0.45 * path);
    return 0.8 * fractal_noise(x / 13, 0, z / 13, seed_ + 5, 3) + rough + 3.2 * smooth_step(0.5, 1.1, u) +
           4 * (1 - taper(z));
  }
  Vec3 ground_point(double u, double z) const {
    const double x = center(z) + u * (half_width(z) * taper(z) + 6);
    return Vec3(x, ground(x, z), z);
  }
  /// `angle` 0 is the right wall, pi the left one.
  Vec3 arch_point(float angle, double z) const {
    const SinCos turn = sin_cos(angle);
    const double x = center(z) + half_width(z) * taper(z) * turn.cos, y = height(z) * taper(z) * turn.sin;
    const double folds = 2.1 * ridged_noise(x / 10, y / 7, z / 10, seed_ + 23, octaves_);
    const double strata = 0.35 * gradient_noise(x / 30, y / 0.8, z / 30, seed_ + 29);
    const double inward = (folds + strata) * std::min(1.0, taper(z) * 1.2) - 1;
    return Vec3(x - inward * turn.cos, y - inward * turn.sin, z);
  }

 private:
  uint32_t seed_;
  int octaves_;
};

struct TerrainMaterials {
  uint32_t ground, arch, rock[3], lime, panel, lantern;
};

TerrainMaterials add_materials(gltf::Document& document) {
  TerrainMaterials m;
  m.ground = add_material(document, rough_material("ground", {0.50f, 0.37f, 0.25f}));
  m.arch = add_material(document, rough_material("arch", {0.44f, 0.45f, 0.48f}));
  m.rock[0] = add_material(document, rough_material("rock grey", {0.38f, 0.38f, 0.40f}, 0.8));
  m.rock[1] = add_material(document, rough_material("rock red", {0.52f, 0.29f, 0.19f}, 0.9));
  m.rock[2] = add_material(document, metal_material("ore", {0.72f, 0.56f, 0.38f}, 0.35));
  m.lime = add_material(document, rough_material("limestone", {0.74f, 0.68f, 0.58f}, 0.45));
  m.panel = add_material(document, emissive_material("panel", {4.0f, 4.6f, 5.4f}));
  m.lantern = add_material(document, emissive_material("lantern", {9, 3.4f, 0.8f}));
  return m;
}

struct PlacedRock {
  Rock rock;
  uint32_t material;
  double area;  ///< relative, for its share of the triangles
};

std::vector<PlacedRock> place_rocks(const Cave& cave, const TerrainMaterials& materials, uint64_t seed,
                                    size_t count) {
  RandomStream random(seed, 1);
  std::vector<PlacedRock> rocks;
  while (rocks.size() < count) {
    const double z = random.uniform(static_cast<float>(kFar + 8), static_cast<float>(kNear - 13));
    float u = random.uniform(-1, 1);
    u = u < 0 ? -std::sqrt(-u) : std::sqrt(u);  // more at the sides
    const double reach = cave.half_width(z) * cave.taper(z) * 0.95;
    const double x = cave.center(z) + u * reach;
    const float size = 0.25f + 1.9f * random.uniform() * random.uniform() * random.uniform();
    const float kind = random.uniform();
    const uint32_t pick = random.below(8);
    const auto rock_seed = random.bits();
    const bool in_the_way = std::abs(u) * reach < 2.2 + size;
    if (in_the_way && kind < 0.86f) continue;
    PlacedRock placed;
    placed.rock = Rock{Vec3(x, cave.ground(x, z) + 0.15f * size, z), Vec3(size), 0, 0.5f, rock_seed};
    placed.material = materials.rock[pick < 4 ? 0 : pick < 7 ? 1 : 2];
    if (kind > 0.72f) {  // stalagmites and, hanging, stalactites
      const bool hanging = kind > 0.86f;
      const float tall = (1.0f + 2.6f * random.uniform()) * (hanging ? 0.8f : 1);
      const double arch = cave.height(z) * cave.taper(z) * std::sqrt(std::max(0.0, 1 - double{u} * u));
      placed.rock.center.y = hanging ? static_cast<float>(arch - 1) : placed.rock.center.y + 0.4f * tall;
      placed.rock.radii = Vec3(0.55f + 0.4f * size, tall, 0.55f + 0.4f * size);
      placed.rock.taper = hanging ? -0.8f : 0.8f;
      placed.rock.roughness = 0.7f;
      placed.material = materials.lime;
    }
    const Vec3& r = placed.rock.radii;
    placed.area = r.x * r.x + 2 * r.x * r.y;
    rocks.push_back(placed);
  }
  return rocks;
}

/// Panels under the ceiling and lanterns beside the way; returns their triangles.
uint64_t add_lights(GltfWriter& writer, const Cave& cave, const TerrainMaterials& materials,
                    uint32_t lantern_cells) {
  MeshData panels, lanterns;
  const MeshData ball = unit_sphere(lantern_cells);
  int side = 1;
  for (double z = 2; z > kFar + 10; z -= 17, side = -side) {
    const double roof = cave.height(z) * 0.62;
    const Vec3 center(cave.center(z) + side * 2.5, roof, z);
    panels.append(rectangle(center, Vec3(3.4f, 0.3f * side, 0), Vec3(0, 0, 2.6f)));
    const double lantern_z = z - 8, x = cave.center(lantern_z) - side * 4.2;
    MeshData lantern = ball;
    for (Vec3& p : lantern.positions) p = p * 0.5f + Vec3(x, cave.ground(x, lantern_z) + 0.8, lantern_z);
    lanterns.append(lantern);
  }
  for (MeshData* mesh : {&panels, &lanterns}) mesh->normals.clear(), mesh->uvs.clear();
  gltf::Document& document = writer.document();
  add_mesh_node(document, write_single_mesh(writer, "panels", panels, materials.panel), {}, "panels");
  add_mesh_node(document, write_single_mesh(writer, "lanterns", lanterns, materials.lantern), {}, "lanterns");
  return panels.triangles_count() + lanterns.triangles_count();
}

void add_view(gltf::Document& document, const Cave& cave) {
  const double z = 3, ahead = -34;
  const Vec3 eye(cave.center(z) + 0.5, cave.ground(cave.center(z) + 0.5, z) + 2.1, z);
  const Vec3 target(cave.center(ahead), 4.2, ahead);
  add_camera(document, "along the cave", eye, target, 0.98);
}

}  // namespace

Status generate_terrain(const GenerateContext& context, GltfWriter& writer, GenerateReport& report) {
  const uint64_t triangles = context.options.triangles;
  const auto seed = static_cast<uint32_t>(context.options.seed ^ (context.options.seed >> 32));
  // The ground and the arch have about 2200 and 4200 square metres; cells are 2 triangles.
  const double cell = std::sqrt(6400.0 / (0.35 * static_cast<double>(triangles)));
  const Cave cave(seed, cell);
  gltf::Document& document = writer.document();
  const TerrainMaterials materials = add_materials(document);
  const uint64_t light_triangles = add_lights(writer, cave, materials, triangles < 20000 ? 1 : 4);
  add_view(document, cave);

  SurfaceWriter surfaces(writer, [&](uint64_t done) { context.report_progress("writing", done, triangles); });
  gltf::Mesh rocks_mesh, ground_mesh, arch_mesh;
  rocks_mesh.name = "rocks", ground_mesh.name = "ground", arch_mesh.name = "arch";
  const auto rocks_count = static_cast<size_t>(std::clamp<uint64_t>(triangles / 400, 6, 700));
  const std::vector<PlacedRock> rocks = place_rocks(cave, materials, context.options.seed, rocks_count);
  double total_area = 0;
  for (const PlacedRock& placed : rocks) total_area += placed.area;
  for (const PlacedRock& placed : rocks) {
    const uint32_t cells = sphere_cells(0.3 * static_cast<double>(triangles) * placed.area / total_area);
    surfaces.add_sphere(rocks_mesh, cells, rock_surface(placed.rock, cells), placed.material);
  }

  const uint64_t used = surfaces.triangles_count() + light_triangles;
  const uint64_t left = triangles > used + 200 ? (triangles - used) / 2 : 100;
  const GridSize ground = grid_of(left * 2 / 5, 0.3);
  const GridSize arch = grid_of(left - ground.columns * ground.rows, 0.38);
  const auto at = [](uint64_t i, uint64_t n) { return static_cast<double>(i) / static_cast<double>(n); };
  surfaces.add_grid(
      ground_mesh, ground,
      [&](uint64_t i, uint64_t j) {
        return cave.ground_point(2 * at(i, ground.columns) - 1, kNear - kLength * at(j, ground.rows));
      },
      materials.ground);
  surfaces.add_grid(
      arch_mesh, arch,
      [&](uint64_t i, uint64_t j) {
        const double angle = kPi + kArchOverlap - (kPi + 2 * kArchOverlap) * at(i, arch.columns);
        return cave.arch_point(static_cast<float>(angle), kNear - kLength * at(j, arch.rows));
      },
      materials.arch);
  for (gltf::Mesh* mesh : {&ground_mesh, &arch_mesh, &rocks_mesh}) {
    const std::string name = mesh->name;
    add_mesh_node(document, add_mesh(document, std::move(*mesh)), {}, name);
  }
  report.triangles_count = report.instanced_triangles_count = surfaces.triangles_count() + light_triangles;
  report.instances_count = 5;
  return writer.status();
}

}  // namespace shoal
