// The attribute page of one treelet (treelets/attribute_layout.h). Corners with equal bits are stored once; an
// array that holds nothing but defaults in this treelet is left out; what is not finite becomes its default. Called by treelets/build_object. Pure. Cost:
// about 0.1 us a triangle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "treelets/triangle_soup.h"

namespace shoal {

/// `triangles` of the soup, by ordinal. Empty when the treelet has one material and nothing but defaults.
std::vector<std::byte> pack_attributes(std::span<const uint32_t> triangles, const TriangleSoup& soup);

}  // namespace shoal
