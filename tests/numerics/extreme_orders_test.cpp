// Scenes of extremes through the whole program's library, in every order: one picture to the bit, all of it finite.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/numerics/built_soup.h"

namespace shoal::testing {
namespace {

using Json = nlohmann::json;

const std::vector<Order> kAllOrders{Order::kDepthFirst, Order::kQueued, Order::kSorted, Order::kHybrid};

/// Renders in these orders, expects one picture of numbers and nothing dropped; returns it.
std::vector<float> render_every_order(MemoryFileSystem& fs, const PictureOptions& picture,
                                      uint64_t vertices_at_least = 1,
                                      const std::vector<Order>& orders = kAllOrders) {
  const BuiltScene built = build_and_open(fs);
  std::vector<float> first;
  for (const Order order : orders) {
    ExecutionOptions execution;
    execution.order = order, execution.threads = 2, execution.rays_in_flight = 256;
    const auto result = render(fs, built.scene, picture, execution);
    if (!result.ok()) {
      ADD_FAILURE() << result.error().message;
      continue;
    }
    EXPECT_EQ(result.value().counters.invalid_samples_count, 0u) << order_name(order);
    EXPECT_GE(result.value().counters.vertices_shaded_count, vertices_at_least) << order_name(order);
    const std::vector<float>& rgba = result.value().rgba;
    for (const float value : rgba) EXPECT_TRUE(std::isfinite(value) && value >= 0) << order_name(order);
    if (first.empty()) first = rgba;
    EXPECT_EQ(std::memcmp(first.data(), rgba.data(), first.size() * sizeof(float)), 0) << order_name(order);
  }
  return first;
}

/// A rectangle at `corner` spanned by two edges.
void add_rectangle(WrittenScene& scene, const Vec3& corner, const Vec3& a, const Vec3& b, uint32_t material) {
  std::vector<float> positions;
  for (const Vec3& p : {corner, corner + a, corner + a + b, corner + b}) positions.insert(positions.end(), {p.x, p.y, p.z});
  const uint32_t position = scene.add_floats(3, positions);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", position}}},
                                           {"indices", scene.add_indices({0, 1, 2, 0, 2, 3})},
                                           {"material", material}})}});
}

Json lamp_of(double radiance) {
  return {{"emissiveFactor", {1, 1, 1}},
          {"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}}},
          {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", radiance}}},
                          {"KHR_materials_specular", {{"specularFactor", 0}}}}}};
}

void look_down(WrittenScene& scene, const Vec3& from, float half) {
  scene.json["cameras"] = {{{"type", "orthographic"},
                            {"orthographic", {{"xmag", half}, {"ymag", half}, {"znear", 0}, {"zfar", 10}}}}};
  scene.add_node({{"camera", 0}, {"translation", {from.x, from.y, from.z}}});
}

TEST(ExtremeOrders, APixelOfTenToTheTenBesideOneOfItsInverse) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.json["materials"] = {lamp_of(1e10), lamp_of(1e-10)};
  add_rectangle(scene, {-1, -1, 0}, {1, 0, 0}, {0, 2, 0}, 0);
  add_rectangle(scene, {0, -1, 0}, {1, 0, 0}, {0, 2, 0}, 1);
  look_down(scene, {0, 0, 1}, 1);
  scene.save(fs);
  PictureOptions picture;
  picture.width = picture.height = 2, picture.samples = 1 << 13;
  const std::vector<float> rgba = render_every_order(fs, picture);
  EXPECT_NEAR(rgba[0] / 1e10, 1, 1e-6);
  EXPECT_NEAR(rgba[4] / 1e-10, 1, 1e-6);
}

TEST(ExtremeOrders, LampsOfNoSizeAndOnSurfacesAndMirrorsOfNoRoughness) {
  MemoryFileSystem fs;
  WrittenScene scene;
  Json mirror = {{"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", 0}}}};
  Json floor = {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0}}}};
  Json glass = {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0}}},
                {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                                {"KHR_materials_volume", {{"thicknessFactor", 1}, {"attenuationDistance", 1e-30},
                                                          {"attenuationColor", {1, 1, 0.5}}}},
                                {"KHR_materials_ior", {{"ior", 1.000001}}}}}};
  Json strong = glass;
  strong["extensions"]["KHR_materials_ior"]["ior"] = 0;
  strong["extensions"]["KHR_materials_volume"]["attenuationDistance"] = 1e30;
  scene.json["materials"] = {floor, lamp_of(1e10), lamp_of(3), mirror, glass, strong};
  add_rectangle(scene, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, 0);
  add_rectangle(scene, {0.2f, 0.2f, 1}, {1e-6f, 0, 0}, {0, 1e-6f, 0}, 1);   // an area of 1e-12
  add_rectangle(scene, {-1, -1, 0}, {0.5f, 0, 0}, {0, 0.5f, 0}, 2);         // in the floor
  add_rectangle(scene, {-1, 0.5f, 1e-38f}, {0.5f, 0, 0}, {0, 0.5f, 0}, 2);  // as near above it as can be
  add_rectangle(scene, {0.5f, -1, 0}, {0, 1, 0}, {0, 0, 0.5f}, 3);          // stands on it
  add_rectangle(scene, {0.1f, -1, 0.2f}, {0.3f, 0, 0}, {0, 0.3f, 0}, 4);
  add_rectangle(scene, {0.1f, 0.5f, 1e-7f}, {0.4f, 0, 0}, {0, 0.4f, 0}, 5);
  look_down(scene, {0, 0, 1.5f}, 1.2f);
  scene.save(fs);
  PictureOptions picture;
  picture.width = picture.height = 24, picture.samples = 8;
  picture.shading.bounces = 30;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1e-10f), {}};
  const std::vector<float> rgba = render_every_order(fs, picture);
  double sum = 0;
  for (const float value : rgba) sum += value;
  EXPECT_GT(sum, 1);
}

TEST(ExtremeOrders, TenThousandBouncesInGlass) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0}}},
                              {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                                              {"KHR_materials_volume", {{"thicknessFactor", 1}}},
                                              {"KHR_materials_ior", {{"ior", 2.4}}}}}}};
  const Vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), c(-1, -1, -1);
  add_rectangle(scene, c, y, x, 0), add_rectangle(scene, c + z, x, y, 0);
  add_rectangle(scene, c, z, y, 0), add_rectangle(scene, c + x, y, z, 0);
  add_rectangle(scene, c, x, z, 0), add_rectangle(scene, c + y, z, x, 0);
  scene.json["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 0.2}, {"aspectRatio", 1}, {"znear", 0.01}}}}};
  // From within, at a corner: every wall is met beyond the angle of total reflection.
  scene.add_node({{"camera", 0}, {"translation", {0.1, 0.2, 0.3}}, {"rotation", {0.2865, -0.3183, 0, 0.9036}}});
  scene.save(fs);
  PictureOptions picture;
  picture.width = picture.height = 4, picture.samples = 1;
  picture.shading.bounces = 10000;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  // Of 16 paths a few may be refracted, as lobes have a width. Waves of so few rays cost more than their rays: not sorted.
  render_every_order(fs, picture, 10 * 10000, {Order::kDepthFirst, Order::kQueued, Order::kHybrid});
}

}  // namespace
}  // namespace shoal::testing
