// Streams of some thousand rays, filtered at every node (treelets/trace_stream).
#include "engine/path_stream.h"

namespace shoal {

void render_stream(RenderContext& context) {
  render_streamed(context, Order::kStream,
                  [](const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches) {
                    return make_stream_traversal(tree, pages, test, touches);
                  });
}

}  // namespace shoal
