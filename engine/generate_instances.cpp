#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/generate_kinds.h"
#include "engine/generate_plants.h"
#include "engine/generate_rocks.h"
#include "engine/generate_surfaces.h"
#include "engine/generate_textures.h"
#include "engine/math.h"
#include "engine/noise.h"
#include "engine/scene_composer.h"

namespace shoal {
namespace {

struct Model {
  uint32_t mesh = 0;
  uint64_t triangles = 0;
  float largest_scale = 1;
  double share = 0;  ///< of the instances
};

constexpr double kGroundShare = 0.08;  // of the triangles
constexpr double kMetresEach = 2.3;    // an instance stands on about this much squared

/// Gentle hills, flat where the camera stands.
double hill(double x, double z, uint32_t seed) {
  const double away = smooth_step(4, 30, std::sqrt(x * x + z * z));
  return (2.6 * gradient_noise(x / 34, 0, z / 34, seed) + 0.9 * gradient_noise(x / 11, 3, z / 11, seed + 1)) *
             away +
         0.12 * gradient_noise(x / 2.1, 5, z / 2.1, seed + 2);
}

/// Where the trail runs; kept free of trees.
double trail_x(double z, uint32_t seed) {
  return 5 * gradient_noise(0, 0, z / 26, seed + 9) * smooth_step(2, 20, -z);
}

Result<std::vector<Model>> write_models(const GenerateContext& context, GltfWriter& writer, double triangles_each,
                                        GenerateReport& report) {
  gltf::Document& document = writer.document();
  SHOAL_RETURN_IF_ERROR(write_texture(context, "leaves.png", 512, 512, paint_leaves, report));
  SHOAL_RETURN_IF_ERROR(write_texture(context, "frond.png", 256, 512, paint_frond, report));
  const uint32_t bark = add_material(document, rough_material("bark", {0.22f, 0.15f, 0.10f}, 0.9));
  gltf::Material leaf = rough_material("leaf", {1, 1, 1}, 0.6);
  leaf.double_sided = true;
  const uint32_t leaves = add_material(document, leaf);
  gltf::Material card = leaf;
  card.name = "leaf cards", card.alpha_mode = gltf::AlphaMode::kMask, card.alpha_cutoff = 0.5;
  card.base_color_texture = gltf::TextureInfo{add_texture(document, "leaves.png", true), 0};
  const uint32_t cards = add_material(document, card);
  gltf::Material soft = leaf;
  soft.name = "frond", soft.alpha_mode = gltf::AlphaMode::kBlend;
  soft.base_color_texture = gltf::TextureInfo{add_texture(document, "frond.png", true), 0};
  const uint32_t frond = add_material(document, soft);
  const uint32_t stone = add_material(document, rough_material("stone", {0.42f, 0.41f, 0.39f}, 0.85));

  std::vector<Model> models;
  const auto add = [&](const char* name, const Plant& plant, uint32_t material, float scale, double share) {
    gltf::Mesh mesh;
    mesh.name = name;
    if (!plant.wood.indices.empty()) mesh.primitives.push_back(write_mesh(writer, plant.wood, bark));
    mesh.primitives.push_back(write_mesh(writer, plant.leaves, material));
    models.push_back({add_mesh(document, std::move(mesh)), plant.triangles_count(), scale, share});
  };
  // Budgets in units of the mean; with the shares they average 1.
  const auto budget = [&](double units) { return static_cast<uint64_t>(std::max(6.0, units * triangles_each)); };
  const auto seed = static_cast<uint32_t>(context.options.seed);
  add("broadleaf tree", broadleaf_tree(budget(2.4), seed), leaves, 1.3f, 0.14);
  add("conifer", conifer_tree(budget(2.0), seed + 1), leaves, 1.35f, 0.16);
  add("bush", card_bush(budget(0.9), seed + 2), cards, 1.2f, 0.14);
  add("fern", fern(budget(0.5), seed + 3), frond, 1.2f, 0.14);
  add("grass", grass_tuft(budget(0.35), seed + 4), leaves, 1.4f, 0.34);
  gltf::Mesh rock;
  rock.name = "rock";
  SurfaceWriter surfaces(writer);
  const uint32_t cells = sphere_cells(0.5 * triangles_each);
  surfaces.add_sphere(rock, cells, rock_surface({Vec3(0, 0.2f, 0), Vec3(0.6f, 0.45f, 0.6f), 0, 0.6f, seed}, cells),
                      stone);
  models.push_back({add_mesh(document, std::move(rock)), surfaces.triangles_count(), 1.5f, 0.08});
  return models;
}

/// Strews instances over the plane until `target` triangles are seen; returns how many are.
uint64_t strew(const GenerateContext& context, gltf::Document& document, const std::vector<Model>& models,
               uint64_t target, uint64_t planned, GenerateReport& report) {
  RandomStream random(context.options.seed, 21);
  const auto seed = static_cast<uint32_t>(context.options.seed);
  const double depth = std::sqrt(static_cast<double>(planned)) * kMetresEach;
  const Model& smallest = *std::min_element(
      models.begin(), models.end(), [](const Model& a, const Model& b) { return a.triangles < b.triangles; });
  uint64_t seen = 0;
  for (uint64_t k = 0; seen < target && report.instances_count < planned * 8; ++k) {
    double pick = random.uniform();
    const Model* model = &models.back();
    for (const Model& candidate : models) {
      if (pick < candidate.share) {
        model = &candidate;
        break;
      }
      pick -= candidate.share;
    }
    if (seen + model->triangles > target + target / 200) model = &smallest;
    if (seen + model->triangles > target + target / 100) break;
    // R2, the plane's most even additive sequence (Roberts 2018), in 32-bit fixed point.
    const double along = static_cast<uint32_t>(k * 3242174889u) * 0x1p-32;
    const double across = static_cast<uint32_t>(k * 2447445414u) * 0x1p-32;
    const double z = 6 - (depth + 6) * along, x = (across - 0.5) * (depth * 0.5 + 12 + depth * along * 0.7);
    const bool tall = model == &models[0] || model == &models[1];
    const double off_trail = std::abs(x - trail_x(z, seed));
    if (off_trail < (tall ? 3.2 : 0.7) || (tall && z > -4)) continue;
    const float scale = model->largest_scale * random.uniform(0.55f, 1.0f);
    const Vec3 stretch(scale * random.uniform(0.85f, 1.15f), scale * random.uniform(0.85f, 1.2f), scale);
    const bool mirrored = random.below(3) == 0;
    const Vec3 origin(x, hill(x, z, seed) - 0.04, z);
    add_mesh_node(document, model->mesh,
                  turned(origin, 2 * kPi * random.uniform(), stretch * Vec3(mirrored ? -1 : 1, 1, 1)));
    seen += model->triangles;
    ++report.instances_count;
  }
  return seen;
}

}  // namespace

Status generate_instances(const GenerateContext& context, GltfWriter& writer, GenerateReport& report) {
  const uint64_t triangles = context.options.triangles;
  const auto seed = static_cast<uint32_t>(context.options.seed);
  const uint64_t planned = std::clamp<uint64_t>(triangles / 3000, 60, 20000);
  const auto ground_cells = static_cast<uint64_t>(kGroundShare * static_cast<double>(triangles) / 2);
  const uint64_t for_models = triangles - 2 * ground_cells;
  const double each = static_cast<double>(for_models) / static_cast<double>(planned);
  gltf::Document& document = writer.document();
  SHOAL_ASSIGN_OR_RETURN(const std::vector<Model> models, write_models(context, writer, each, report));
  for (const Model& model : models) report.triangles_count += model.triangles;

  const uint32_t soil = add_material(document, rough_material("soil", {0.27f, 0.23f, 0.13f}));
  const double side = std::sqrt(static_cast<double>(planned)) * kMetresEach * 1.4 + 30;
  const GridSize grid = grid_of(ground_cells, 1);
  SurfaceWriter surfaces(writer,
                         [&](uint64_t done) { context.report_progress("writing", done, 2 * ground_cells); });
  gltf::Mesh ground;
  ground.name = "ground";
  surfaces.add_grid(
      ground, grid,
      [&](uint64_t i, uint64_t j) {
        const double x = side * (static_cast<double>(i) / static_cast<double>(grid.columns) - 0.5);
        const double z = 20 - side * static_cast<double>(j) / static_cast<double>(grid.rows);
        return Vec3(x, hill(x, z, seed), z);
      },
      soil);
  add_mesh_node(document, add_mesh(document, std::move(ground)), {}, "ground");
  report.instances_count = 1;
  const uint64_t seen = strew(context, document, models, triangles - surfaces.triangles_count(), planned, report);
  report.triangles_count += surfaces.triangles_count();
  report.instanced_triangles_count = seen + surfaces.triangles_count();

  add_sun(document, {-0.62f, -0.5f, -0.32f}, {1.0f, 0.86f, 0.66f}, 5.5);
  add_camera(document, "trail", Vec3(0, static_cast<float>(hill(0, 3, seed)) + 1.75f, 3), Vec3(0.4f, 2.0f, -20),
             0.85);
  return writer.status();
}

}  // namespace shoal
