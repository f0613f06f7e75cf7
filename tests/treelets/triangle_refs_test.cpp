#include "treelets/triangle_refs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/sample_soups.h"

namespace shoal {
namespace {

// The definitions, a number at a time.
bool expected_degenerate(const float* p) {
  for (int i = 0; i < 9; ++i) {
    if (!(std::fabs(p[i]) <= kMaxCoordinate)) return true;
  }
  return std::equal(p, p + 3, p + 3) || std::equal(p + 3, p + 6, p + 6) || std::equal(p, p + 3, p + 6);
}

BuildRef expected_ref(const float* p, uint32_t id) {
  BuildRef ref{};
  ref.id = id;
  for (int axis = 0; axis < 3; ++axis) {
    ref.lo[axis] = std::min({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
    ref.hi[axis] = std::max({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
  }
  return ref;
}

void expect_refs(const std::vector<float>& positions) {
  std::vector<BuildRef> expected;
  for (size_t i = 0; i < positions.size() / 9; ++i) {
    const float* p = &positions[9 * i];
    ASSERT_EQ(is_degenerate(p), expected_degenerate(p)) << "triangle " << i;
    if (!expected_degenerate(p)) expected.push_back(expected_ref(p, static_cast<uint32_t>(i)));
  }
  const RefArray refs = make_refs(positions);
  ASSERT_EQ(refs.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    const BuildRef &a = refs.refs()[i], &b = expected[i];
    ASSERT_EQ(a.id, b.id);
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_EQ(a.lo[axis], b.lo[axis]);
      ASSERT_EQ(a.hi[axis], b.hi[axis]);
      ASSERT_FALSE(std::signbit(a.lo[axis]) && a.lo[axis] == 0) << "one zero only";
      ASSERT_FALSE(std::signbit(a.hi[axis]) && a.hi[axis] == 0) << "one zero only";
    }
  }
}

TEST(TriangleRefs, AreTheBoxesOfTriangles) {
  for (const uint32_t count : {0u, 1u, 1000u, 40000u}) expect_refs(testing::random_soup(count, 0.1f).positions);
}

TEST(TriangleRefs, LeaveOutDegenerateTrianglesWhereverTheyAre) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const float beyond = std::nextafter(kMaxCoordinate, inf);
  testing::Numbers numbers(5);
  std::vector<float> positions = testing::random_soup(50000, 0.1f).positions;
  for (size_t i = 0; i < positions.size() / 9; ++i) {
    float* p = &positions[9 * i];
    const uint32_t at = numbers.below(9), corner = numbers.below(3);
    switch (i < 17000 || i > 49990 ? numbers.below(8) : 9) {  // whole runs of them, and none
      case 0: p[at] = nan; break;
      case 1: p[at] = numbers.below(2) == 0 ? inf : -inf; break;
      case 2: p[at] = numbers.below(2) == 0 ? beyond : -beyond; break;
      case 3: p[at] = numbers.below(2) == 0 ? kMaxCoordinate : -kMaxCoordinate; break;
      case 4: std::copy_n(p + 3 * corner, 3, p + 3 * ((corner + 1) % 3)); break;
      case 5:
        for (int k = 0; k < 3; ++k) p[3 * corner + k] = 0.0f, p[3 * ((corner + 1) % 3) + k] = -0.0f;
        break;
      case 6: p[at] = -0.0f; break;
      default: break;
    }
  }
  expect_refs(positions);
}

TEST(TriangleRefs, AreNoneWhenEveryTriangleIsDegenerate) {
  EXPECT_EQ(make_refs(std::vector<float>(9 * 20000, 1.0f)).size(), 0u);
}

}  // namespace
}  // namespace shoal
