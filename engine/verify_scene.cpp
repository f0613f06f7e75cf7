#include "engine/scene.h"

namespace shoal {

Status verify_scene(const Scene& scene) {
  SHOAL_RETURN_IF_ERROR(scene.file->verify());
  std::vector<std::byte> page;
  for (const PageRecord& record : scene.file->records()) {
    if (record.kind == PageKind::kTable) continue;
    page.assign(record.raw_bytes + 64ull, std::byte{0});  // readers of treelets may load 64 bytes past the end
    uint64_t read_bytes = 0;
    const std::span<std::byte> bytes(page.data(), record.raw_bytes);
    SHOAL_RETURN_IF_ERROR(scene.file->read_page(record.id, bytes, &read_bytes));
    SHOAL_RETURN_IF_ERROR(check_page(scene, record, bytes));
  }
  return {};
}

}  // namespace shoal
