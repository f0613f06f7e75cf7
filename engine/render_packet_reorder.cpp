// Packets whose rays are put together anew where few of them are left (treelets/trace_packets_reorder).
#include "engine/path_stream.h"

namespace shoal {

void render_packet_reorder(RenderContext& context) {
  render_streamed(context, Order::kPacketReorder,
                  [&](const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches) {
                    return make_reordering_traversal(tree, pages, test, context.packet_rays, touches);
                  });
}

}  // namespace shoal
