// Lambert's surfaces by their own code against the general one, to the bit.
#include "engine/lambert_bsdf.h"

#include <gtest/gtest.h>

#include <random>

#include "engine/energy_table.h"

namespace shoal {
namespace {

class Directions {
 public:
  float number() { return static_cast<float>(random_() >> 8) * 0x1p-24f; }
  Vec3 unit() {
    for (;;) {
      const Vec3 v(2 * number() - 1, 2 * number() - 1, 2 * number() - 1);
      if (const float length = glm::length(v); length > 0.01f && length <= 1) return v / length;
    }
  }

 private:
  std::mt19937 random_{11};
};

void expect_same(const Vec3& a, const Vec3& b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(a[axis], b[axis]);
}

TEST(LambertBsdf, GivesTheBitsOfTheGeneralOneWithNothingButDiffuse) {
  Directions random;
  const EnergyTable table;
  uint32_t lit = 0, black = 0;
  for (int i = 0; i < 20000; ++i) {
    MaterialSample material;
    material.base_color = i % 50 == 0 ? Vec3(0) : Vec3(random.number(), random.number(), random.number());
    material.metallic = 0, material.specular = 0, material.roughness = random.number();
    const Vec3 geometric = random.unit(), shading = glm::normalize(geometric + 0.5f * random.unit());
    const Vec3 wo = random.unit(), wi = random.unit();
    const Bsdf general(material, &table, geometric, shading, wo);
    const LambertBsdf own(material.base_color, geometric, shading, wo);
    ASSERT_EQ(own.black(), general.black());
    black += own.black() ? 1 : 0;
    const BsdfValue expected = general.evaluate(wi), found = own.evaluate(wi);
    expect_same(found.value, expected.value);
    EXPECT_EQ(found.pdf, expected.pdf);
    const float u[3] = {random.number(), random.number(), random.number()};
    const BsdfSample drawn = general.sample(u[0], u[1], u[2]), own_drawn = own.sample(u[0], u[1], u[2]);
    expect_same(own_drawn.direction, drawn.direction);
    expect_same(own_drawn.weight, drawn.weight);
    EXPECT_EQ(own_drawn.pdf, drawn.pdf);
    lit += drawn.pdf > 0 && found.pdf > 0 ? 1 : 0;
  }
  EXPECT_GT(lit, 1000u);
  EXPECT_GT(black, 1000u);
}

}  // namespace
}  // namespace shoal
