#include "queues/ray_sorter.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace shoal {
namespace {

Bounds3 unit_cube() {
  Bounds3 bounds;
  bounds.include(Vec3(0));
  bounds.include(Vec3(1));
  return bounds;
}

struct Start {
  Vec3 origin, direction;
};

/// The slots of the rays in their order; `starts[i]` lies in slot `slots[i]`.
std::vector<uint32_t> sorted_slots(RaySorter& sorter, unsigned parts, const std::vector<Start>& starts,
                                   const std::vector<uint64_t>& slots) {
  for (unsigned part = 0; part < parts; ++part) sorter.clear(part);
  for (size_t i = 0; i < starts.size(); ++i) sorter.set(slots[i], starts[i].origin, starts[i].direction);
  for (uint32_t pass = 0; pass < RaySorter::kPasses; ++pass) {
    for (unsigned part = 0; part < parts; ++part) sorter.count(pass, part);
    for (unsigned part = parts; part-- > 0;) sorter.scatter(pass, part);
  }
  std::vector<uint32_t> order;
  for (uint64_t place = 0; place < sorter.size(); ++place) order.push_back(sorter.slot_at(place));
  return order;
}

TEST(RaySorter, BringsRaysOfACellAndAnOctantTogether) {
  RaySorter sorter(unit_cube(), 1, 8);
  const Vec3 here(0.1f), there(0.9f), up(1, 1, 1), down(-1, 1, 1);
  EXPECT_EQ(sorted_slots(sorter, 1, {{there, up}, {here, down}, {here, up}, {there, down}, {here, down}},
                         {0, 2, 3, 5, 7}),
            (std::vector<uint32_t>{3, 2, 7, 0, 5}));
  EXPECT_EQ(sorted_slots(sorter, 1, {}, {}), std::vector<uint32_t>{}) << "nothing is left of the wave before";
}

TEST(RaySorter, GivesTheSameOrderInAnyNumberOfPartsAndEachRayOnce) {
  constexpr uint64_t kSlots = 20000;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> number(-0.5f, 1.5f);  // some outside of the scene
  std::vector<Start> starts;
  std::vector<uint64_t> slots;
  for (uint64_t slot = 0; slot < kSlots; ++slot) {
    if (number(random) > 1) continue;
    starts.push_back({{number(random), number(random), number(random)},
                      {number(random) - 0.5f, number(random) - 0.5f, number(random) - 0.5f}});
    slots.push_back(slot);
  }
  RaySorter alone(unit_cube(), 1, kSlots);
  const std::vector<uint32_t> expected = sorted_slots(alone, 1, starts, slots);
  std::vector<bool> seen(kSlots);
  for (const uint32_t slot : expected) {
    EXPECT_FALSE(seen[slot]) << slot;
    seen[slot] = true;
  }
  EXPECT_EQ(expected.size(), slots.size());
  for (const unsigned parts : {2u, 3u, 7u}) {
    RaySorter sorter(unit_cube(), parts, kSlots);
    EXPECT_EQ(sorted_slots(sorter, parts, starts, slots), expected) << parts;
    EXPECT_EQ(sorted_slots(sorter, parts, starts, slots), expected) << parts << ", once more";
  }
}

TEST(RaySorter, TakesAnyOriginAndABoxWithoutExtent) {
  Bounds3 flat;
  flat.include(Vec3(2));
  RaySorter sorter(flat, 2, 4);
  const float infinite = std::numeric_limits<float>::infinity(), none = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(sorted_slots(sorter, 2, {{Vec3(none), Vec3(1)}, {Vec3(-infinite), Vec3(1)}, {Vec3(infinite), Vec3(1)}},
                         {0, 1, 3}),
            (std::vector<uint32_t>{0, 1, 3}));
}

}  // namespace
}  // namespace shoal
