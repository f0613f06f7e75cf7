// The box test's properties: it never loses a point of the box, it is monotone, and it makes no NaN.
#include "treelets/box_test.h"

#include <gtest/gtest.h>

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {
namespace {

RaySpace random_space(std::mt19937& random, float pad) {
  Vec3 direction = random_vector(random);
  if (random() % 4 == 0) direction[static_cast<int>(random() % 3)] = random() % 2 ? 0.0f : -0.0f;
  if (random() % 8 == 0) direction[static_cast<int>(random() % 3)] = 1e-42f;
  RaySpace space = prepare_ray(random_vector(random, 2), direction);
  set_pad(space, pad, 2);
  return space;
}

TEST(BoxTest, WhatEntersAnInnerBoxEntersTheOuterNoLater) {
  std::mt19937 random(1);
  size_t entered = 0;
  for (int i = 0; i < 300000; ++i) {
    const RaySpace space = random_space(random, i % 2 ? 0.0f : 1e-6f);
    Bounds3 inner, outer;
    inner.include(random_vector(random)), inner.include(random_vector(random));
    if (i % 5 == 0) inner.hi.x = inner.lo.x;  // flat
    outer = inner;
    if (i % 3 != 0) outer.include(random_vector(random));
    if (i % 7 == 0) outer.hi.y = std::nextafter(outer.hi.y, 9.0f);
    const BoxSpan a = cross_box(space, &inner.lo.x, &inner.hi.x), b = cross_box(space, &outer.lo.x, &outer.hi.x);
    EXPECT_LE(b.t_near, a.t_near);
    EXPECT_GE(b.t_far, a.t_far);
    const float t = std::abs(random_vector(random, 3).x);
    EXPECT_TRUE(!a.entered(t) || b.entered(t));
    entered += a.entered(t);
  }
  EXPECT_GT(entered, 3000u);
}

TEST(BoxTest, ARayThroughAPointOfTheBoxEntersIt) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < 300000; ++i) {
    Bounds3 box;
    box.include(random_vector(random)), box.include(random_vector(random));
    if (i % 3 == 0) box.hi[i % 9 / 3] = box.lo[i % 9 / 3];
    const Vec3 weight = i % 2 ? Vec3(uniform(random), uniform(random), uniform(random))
                              : Vec3(random() % 2, random() % 2, random() % 2);  // corners
    Vec3 target;
    for (int axis = 0; axis < 3; ++axis) {
      target[axis] =
          std::clamp(box.lo[axis] + weight[axis] * (box.hi[axis] - box.lo[axis]), box.lo[axis], box.hi[axis]);
    }
    // The direction is rounded by u R: within the pad at t = 1.
    const Vec3 origin = random_vector(random, i % 5 ? 2.0f : 1000.0f);
    RaySpace space = prepare_ray(origin, target - origin);
    set_pad(space, object_pad(space, 1), 2);
    EXPECT_TRUE(cross_box(space, &box.lo.x, &box.hi.x).entered(1.00001f)) << i;
  }
}

TEST(BoxTest, ABoxThatBeginsAtExactlyTheEndIsEntered) {
  RaySpace space = prepare_ray({0, 0, 0}, {1, 0, 0});
  set_pad(space, 0, 1);
  const float lo[3] = {2, -1, -1}, hi[3] = {3, 1, 1};
  const BoxSpan span = cross_box(space, lo, hi);
  EXPECT_EQ(span.t_near, 2);
  EXPECT_TRUE(span.entered(2));
  EXPECT_FALSE(span.entered(std::nextafter(2.0f, 0.0f)));
}

TEST(BoxTest, MakesNoNanFromZeroHugeOrSubnormalNumbers) {
  const float values[] = {0.0f, -0.0f, 1.0f, -1e-45f, 1e-39f, 1e38f, -3.4e38f, 3.4e38f};
  std::mt19937 random(3);
  const auto pick = [&] { return Vec3(values[random() % 8], values[random() % 8], values[random() % 8]); };
  for (int i = 0; i < 200000; ++i) {
    RaySpace space = prepare_ray(pick(), pick());
    set_pad(space, values[random() % 2 ? 0 : 4], 1);
    Bounds3 box;
    box.include(pick()), box.include(pick());
    const BoxSpan span = cross_box(space, &box.lo.x, &box.hi.x);
    EXPECT_FALSE(std::isnan(span.t_near) || std::isnan(span.t_far));
  }
}

TEST(BoxTest, PowersOfTwoAreExact) {
  for (int e = kMinGridPower; e <= 127; ++e)
    EXPECT_EQ(power_of_two(static_cast<int8_t>(e)), std::ldexp(1.0f, e)) << e;
}

TEST(BoxTest, EntryKeysOrderByTimeThenSlot) {
  EXPECT_LT(entry_key(1, 7), entry_key(2, 0));
  EXPECT_LT(entry_key(1, 3), entry_key(1, 4));
  EXPECT_LT(entry_key(-0.0f, 0), entry_key(0.0f, 1));
  EXPECT_LE(key_t(entry_key(0.1f, 7)), 0.1f);
}

}  // namespace
}  // namespace shoal::testing
