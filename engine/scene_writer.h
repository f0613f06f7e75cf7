// The .shoal file while it is being written: treelets as the builder finishes them, then the tables.
// Used by engine/build_scene from one thread at a time. Cost: the page writer's.
#pragma once

#include <atomic>

#include <span>
#include <vector>

#include "engine/scene_tables.h"
#include "io/page_file.h"
#include "treelets/treelet_sink.h"

namespace shoal {

/// Appends a geometry page and, where there is one, its attribute page.
class TreeletPageSink : public TreeletSink {
 public:
  /// `stop`: may be nullptr; add() fails with kStopped once it is true.
  TreeletPageSink(PageFileWriter& writer, const std::atomic<bool>* stop) : writer_(&writer), stop_(stop) {}
  Result<TreeletId> add(std::span<const std::byte> geometry, std::span<const std::byte> attributes) override;

  const std::vector<TreeletPages>& treelets() const { return treelets_; }
  /// Sums and maxima of the pages so far.
  void fill(SceneHeader& header) const;

 private:
  PageFileWriter* writer_;
  const std::atomic<bool>* stop_;
  std::vector<TreeletPages> treelets_;
  uint64_t geometry_bytes_ = 0, attribute_bytes_ = 0;
  uint32_t largest_geometry_bytes_ = 0, largest_attribute_bytes_ = 0;
};

template <class T>
Status append_rows(PageFileWriter& writer, TableId table, const std::vector<T>& rows) {
  return writer.append_table(table, std::as_bytes(std::span(rows)));
}

}  // namespace shoal
