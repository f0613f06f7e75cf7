// The path loop of the orders that trace each ray from its start to its end, everything in memory: hybrid, packet,
// packet-reorder and stream (engine/render_*.cpp) differ in the traversal alone. A thread has some thousand paths
// under way; of those that are home it makes the next rays all at once, so that rays of a kind follow each other.
// Where the cache cannot hold every page another order renders (engine/choose_order, engine/memory_plan). One
// traversal a thread.
#pragma once

#include <functional>
#include <memory>

#include "engine/render_worker.h"
#include "treelets/scene_traversal.h"

namespace shoal {

/// The last: is told what is touched, or none.
using MakeTraversal =
    std::function<std::unique_ptr<SceneTraversal>(const TopTree&, PageTable, TriangleTest, TouchLog*)>;

/// Returns when every sample is in the film or context.ended is set. Requires: a cache with room for every page.
void render_streamed(RenderContext& context, Order order, const MakeTraversal& make);

}  // namespace shoal
