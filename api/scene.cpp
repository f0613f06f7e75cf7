#include "api/scene_impl.h"
#include "engine/memory_plan.h"

namespace shoal::api {

const char* version() { return SHOAL_VERSION; }

Scene::Scene(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;
Scene::~Scene() = default;

Result<Scene> Scene::open(const std::string& path, bool buffered) {
  return within_memory<Scene>([&]() -> Result<Scene> {
    auto opened = open_scene(posix_file_system(), path, buffered ? ReadMode::kBuffered : ReadMode::kDirect, {});
    if (!opened.ok()) return public_error(opened.error());
    return Scene(std::make_shared<const Impl>(Impl{std::move(opened).value()}));
  });
}

Bounds Scene::bounds() const {
  const Bounds3 box = impl_->scene.top_tree.bounds();
  return {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}};
}

uint64_t Scene::triangle_count() const { return impl_->scene.header.instanced_triangles_count; }
uint32_t Scene::instance_count() const { return impl_->scene.top_tree.instance_count(); }
uint64_t Scene::page_bytes() const { return decoded_page_bytes(*impl_->scene.file); }
uint64_t Scene::resident_bytes() const { return impl_->scene.resident_bytes(); }

}  // namespace shoal::api
