// By which arithmetic triangles are tested (treelets/triangle_test.h, docs/numerics.md): part of what a picture is, never
// of the order that makes it. Chosen outside of loops: every kernel is compiled once a kind.
#pragma once

#include <cstdint>
#include <string_view>

namespace shoal {

enum class TriangleTest : uint8_t {
  kFast,        ///< edges in float: may let a ray through where triangles meet
  kWatertight,  ///< sheared in float, signs of edges exact
  kDouble,      ///< sheared in double, signs of edges exact
};

inline std::string_view triangle_test_name(TriangleTest test) {
  return test == TriangleTest::kFast ? "fast" : test == TriangleTest::kDouble ? "double" : "watertight";
}

}  // namespace shoal
