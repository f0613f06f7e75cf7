// Packets of a fixed size with one stack, whatever their rays do (treelets/trace_packets).
#include "engine/path_stream.h"

namespace shoal {

void render_packet(RenderContext& context) {
  render_streamed(context, Order::kPacket,
                  [&](const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches) {
                    return make_packet_traversal(tree, pages, test, context.packet_rays, touches);
                  });
}

}  // namespace shoal
