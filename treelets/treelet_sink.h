// Where the builder's finished treelets go: pages of a file, or memory in tests.
#pragma once

#include <cstddef>
#include <span>

#include "io/result.h"
#include "treelets/ray.h"

namespace shoal {

class TreeletSink {
 public:
  virtual ~TreeletSink() = default;
  /// Takes one treelet: the geometry page (treelets/treelet_layout.h) and the attribute page
  /// (treelets/attribute_layout.h; empty when the treelet has no attributes and one material).
  /// Called from one thread at a time, in an order that depends on the input only.
  virtual Result<TreeletId> add(std::span<const std::byte> geometry, std::span<const std::byte> attributes) = 0;
};

}  // namespace shoal
