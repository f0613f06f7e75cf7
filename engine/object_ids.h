// The numbers of AOV object_id: one for every mesh that a node of the scene shows, from 1 on. Meshes that one node shows
// are baked into one object (engine/plan_objects.h), so a table of the .shoal file says where each of them begins.
// Called by engine/render where that AOV is asked for. Immutable, any number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "io/page_file.h"
#include "io/result.h"
#include "treelets/ray.h"

namespace shoal {

class ObjectIds {
 public:
  /// Every instance is an object.
  ObjectIds() = default;
  /// `first_primitives`: of each baked mesh, ascending. Where there are any, instance 0 is made of them.
  explicit ObjectIds(std::vector<uint32_t> first_primitives) : first_primitives_(std::move(first_primitives)) {}
  /// Files written before there was such a table: every instance is an object. Fails with: kCorrupt, kStorage.
  static Result<ObjectIds> read(const PageFile& file);
  /// Memory of what read() returns.
  static uint64_t bytes(const PageFile& file);

  /// Baked meshes in order of the document, then instances. Cost: a binary search.
  uint32_t of(const Hit& hit) const;

 private:
  std::vector<uint32_t> first_primitives_;
};

}  // namespace shoal
