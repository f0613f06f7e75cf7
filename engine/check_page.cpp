#include <fmt/format.h>

#include <algorithm>

#include "engine/scene.h"
#include "engine/tile_textures.h"
#include "treelets/attribute_layout.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_layout.h"

namespace shoal {

namespace {

/// Of a page that passed its own check: a header or array at `offset`, aligned by the page's layout.
template <class T>
const T* at(std::span<const std::byte> bytes, size_t offset) {
  return reinterpret_cast<const T*>(bytes.data() + offset);
}

class PageChecker {
 public:
  PageChecker(const Scene& scene, const PageRecord& record, std::span<const std::byte> bytes)
      : scene_(scene), record_(record), bytes_(bytes) {}

  Status run() const {
    switch (record_.kind) {
      case PageKind::kTreelet:
        return treelet();
      case PageKind::kAttributes:
        return attributes();
      case PageKind::kTexture:
        if (bytes_.size() != kTextureTileBytes) {
          return corrupt(
              fmt::format("texture tile: expected {} bytes, found {}", kTextureTileBytes, bytes_.size()));
        }
        return {};
      case PageKind::kTable:
        return {};
    }
    return corrupt("expected a known kind of page");
  }

 private:
  Error corrupt(const std::string& what) const {
    return Error{ErrorCode::kCorrupt, fmt::format("{}: page {} at offset {}: {}", scene_.file->path(), record_.id,
                                                  record_.offset, what)};
  }

  /// The treelet whose geometry page is `page`, or nothing.
  const TreeletPages* owner(PageId page) const {
    const auto found = std::lower_bound(scene_.treelets.begin(), scene_.treelets.end(), page,
                                        [](const TreeletPages& t, PageId id) { return t.geometry < id; });
    return found != scene_.treelets.end() && found->geometry == page ? &*found : nullptr;
  }

  Status treelet() const {
    const TreeletPages* pages = owner(record_.id);
    if (!pages) return corrupt("expected a treelet of the table");
    if (Status status = check_treelet(bytes_); !status.ok()) return corrupt(status.error().message);
    const TreeletHeader& header = *at<TreeletHeader>(bytes_, 0);
    if (header.triangle_count != pages->triangle_count) {
      return corrupt(fmt::format("expected {} triangles, found {}", pages->triangle_count, header.triangle_count));
    }
    const uint32_t material = header.uniform_material;
    if (material == kNoIndex ? pages->attributes == kNoPage : material >= scene_.materials.size()) {
      return corrupt(fmt::format("expected a material below {} or an attribute page, found {}",
                                 scene_.materials.size(), material));
    }
    return roots(static_cast<TreeletId>(pages - scene_.treelets.data()));
  }

  /// Every entry of the top tree that leads here must lead to a node or leaf of the page.
  Status roots(TreeletId treelet) const {
    const auto& entries = scene_.top_tree.entries();
    auto entry = std::lower_bound(scene_.entries_by_treelet.begin(), scene_.entries_by_treelet.end(), treelet,
                                  [&](uint32_t index, TreeletId id) { return entries[index].treelet < id; });
    for (; entry != scene_.entries_by_treelet.end() && entries[*entry].treelet == treelet; ++entry) {
      if (Status status = check_root(bytes_, entries[*entry].root); !status.ok()) {
        return corrupt(fmt::format("root of entry {}: {}", *entry, status.error().message));
      }
    }
    return {};
  }

  Status attributes() const {
    const TreeletPages* pages = record_.id == 0 ? nullptr : owner(record_.id - 1);
    if (!pages || pages->attributes != record_.id) return corrupt("expected a treelet of the table");
    if (Status status = check_attributes(bytes_); !status.ok()) return corrupt(status.error().message);
    const AttributeHeader& header = *at<AttributeHeader>(bytes_, 0);
    if (header.triangle_count != pages->triangle_count) {
      return corrupt(fmt::format("expected {} triangles, found {}", pages->triangle_count, header.triangle_count));
    }
    uint32_t largest = header.uniform_material;
    if (header.uniform_material == kNoIndex) {
      const uint32_t* materials = at<uint32_t>(bytes_, header.materials_offset);
      largest = header.triangle_count == 0 ? 0 : *std::max_element(materials, materials + header.triangle_count);
    }
    if (largest >= scene_.materials.size()) {
      return corrupt(fmt::format("expected materials below {}, found {}", scene_.materials.size(), largest));
    }
    return {};
  }

  const Scene& scene_;
  const PageRecord& record_;
  std::span<const std::byte> bytes_;
};

}  // namespace

Status check_page(const Scene& scene, const PageRecord& record, std::span<const std::byte> bytes) {
  return PageChecker(scene, record, bytes).run();
}

}  // namespace shoal
