#include "engine/object_ids.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/scene_tables.h"

namespace shoal {

uint64_t ObjectIds::bytes(const PageFile& file) {
  if (!file.has_table(tables::kBakedMeshes)) return 0;
  const auto bytes = file.table_bytes(tables::kBakedMeshes, UINT64_MAX);
  return bytes.ok() ? bytes.value() : 0;
}

Result<ObjectIds> ObjectIds::read(const PageFile& file) {
  if (!file.has_table(tables::kBakedMeshes)) return ObjectIds();
  SHOAL_ASSIGN_OR_RETURN(const uint64_t bytes,
                         file.table_bytes(tables::kBakedMeshes, uint64_t{kNoIndex} * sizeof(uint32_t)));
  std::vector<uint32_t> first(bytes / sizeof(uint32_t));
  if (bytes % sizeof(uint32_t) == 0) {
    SHOAL_RETURN_IF_ERROR(file.read_table_into(tables::kBakedMeshes, std::as_writable_bytes(std::span(first))));
  }
  if (bytes % sizeof(uint32_t) != 0 || !std::is_sorted(first.begin(), first.end())) {
    return Error{ErrorCode::kCorrupt, fmt::format("{}: table of baked meshes: expected ascending words, found others",
                                                  file.path())};
  }
  return ObjectIds(std::move(first));
}

uint32_t ObjectIds::of(const Hit& hit) const {
  const auto baked = static_cast<uint32_t>(first_primitives_.size());
  if (baked == 0) return hit.instance + 1;
  if (hit.instance > 0) return baked + hit.instance;
  const auto next = std::upper_bound(first_primitives_.begin(), first_primitives_.end(), hit.primitive);
  return static_cast<uint32_t>(next - first_primitives_.begin());
}

}  // namespace shoal
