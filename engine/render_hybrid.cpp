// Hybrid: rays in packets of 16 while they agree, one by one where they do not (treelets/trace_scene).
#include "engine/path_stream.h"
#include "treelets/trace_scene.h"

namespace shoal {
namespace {

class HybridTraversal final : public SceneTraversal {
 public:
  HybridTraversal(const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches)
      : tracer_(tree, pages, RayGrouping::kAuto, test), touches_(touches) {}
  void trace(RayStream& stream, TraceCounters& counters) override { tracer_.trace(stream, counters, touches_); }

 private:
  SceneTracer tracer_;
  TouchLog* touches_;
};

}  // namespace

void render_hybrid(RenderContext& context) {
  render_streamed(context, Order::kHybrid, [](const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches) {
    return std::make_unique<HybridTraversal>(tree, pages, test, touches);
  });
}

}  // namespace shoal
