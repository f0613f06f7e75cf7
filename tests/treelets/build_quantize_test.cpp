#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/sample_soups.h"
#include "treelets/quantize_boxes.h"

namespace shoal {
namespace {

// Every child lies inside its planes; returns the largest slack in steps of the grid.
float expect_encloses(const std::vector<Bounds3>& boxes, const QuantizedNode& node) {
  float slack = 0;
  EXPECT_EQ(node.child_count, boxes.size());
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GE(node.exponent[axis], kMinGridExponent);
    const float step = std::ldexp(1.0f, node.exponent[axis]);
    for (size_t i = 0; i < 8; ++i) {
      if (i >= boxes.size()) {
        EXPECT_EQ(node.lo[axis][i], 255);
        EXPECT_EQ(node.hi[axis][i], 0);
        continue;
      }
      const float lo = node.origin[axis] + static_cast<float>(node.lo[axis][i]) * step;
      const float hi = node.origin[axis] + static_cast<float>(node.hi[axis][i]) * step;
      EXPECT_LE(lo, boxes[i].lo[axis]);
      EXPECT_GE(hi, boxes[i].hi[axis]);
      slack = std::max({slack, (boxes[i].lo[axis] - lo) / step, (hi - boxes[i].hi[axis]) / step});
    }
  }
  return slack;
}

TEST(QuantizeBoxes, EnclosesRandomBoxesOfEverySize) {
  testing::Numbers numbers(1);
  for (int round = 0; round < 20000; ++round) {
    const float size = std::ldexp(1.0f, static_cast<int>(numbers.below(240)) - 120);
    const float place = std::ldexp(1.0f, static_cast<int>(numbers.below(240)) - 120);
    std::vector<Bounds3> boxes(1 + numbers.below(8));
    for (Bounds3& box : boxes) {
      for (int p = 0; p < 2; ++p) {
        box.include(Vec3(place + size * numbers.uniform(-1, 1), size * numbers.uniform(-1, 1),
                         place * numbers.uniform(-1, 1)));
      }
    }
    QuantizedNode node{};
    quantize_boxes(boxes, node);
    expect_encloses(boxes, node);
  }
}

TEST(QuantizeBoxes, StaysWithinOneStepAwayFromRounding) {
  testing::Numbers numbers(2);
  for (int round = 0; round < 1000; ++round) {
    std::vector<Bounds3> boxes(8);
    for (Bounds3& box : boxes) {
      for (int p = 0; p < 2; ++p) {
        box.include(Vec3(numbers.uniform(0, 1), numbers.uniform(0, 1), numbers.uniform(0, 1)));
      }
    }
    QuantizedNode node{};
    quantize_boxes(boxes, node);
    EXPECT_LE(expect_encloses(boxes, node), 1.001f);
    for (const int8_t exponent : node.exponent) EXPECT_LE(exponent, -7);  // no coarser than 1/128 for a unit cube
  }
}

TEST(QuantizeBoxes, EnclosesFlatDenormalAndEnormousBoxes) {
  const float tiny = std::numeric_limits<float>::denorm_min(), largest = std::numeric_limits<float>::max();
  const std::vector<std::vector<Bounds3>> cases = {
      {{Vec3(1), Vec3(1)}},
      {{Vec3(0), Vec3(tiny)}, {Vec3(tiny), Vec3(3 * tiny)}},
      {{Vec3(-largest), Vec3(largest)}, {Vec3(0), Vec3(1)}},
      {{Vec3(-largest), Vec3(-largest)}, {Vec3(largest), Vec3(largest)}},
      {{Vec3(largest), Vec3(largest)}, {Vec3(0), Vec3(0)}},
      {{Vec3(16777216.0f), Vec3(16777218.0f)}, {Vec3(16777218.0f), Vec3(16777220.0f)}}};
  for (const std::vector<Bounds3>& boxes : cases) {
    QuantizedNode node{};
    quantize_boxes(boxes, node);
    expect_encloses(boxes, node);
  }
}

}  // namespace
}  // namespace shoal
