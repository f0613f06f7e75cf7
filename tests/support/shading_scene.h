// Small scenes for tests of shading, kept in memory, and the plainest path tracer over them: one path at a time,
// one ray after the other. Header only; for targets that link the engine.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "engine/sampler.h"
#include "engine/shade.h"
#include "tests/support/hand_made_scene.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/sample_soups.h"
#include "tests/support/treelet_reader.h"
#include "treelets/build_object.h"

namespace shoal::testing {

inline Material matte(const Vec3& color) {
  Material m{};
  for (int i = 0; i < 3; ++i) m.base_color[i] = color[i], m.specular_color[i] = 1;
  m.base_color[3] = 1, m.roughness = 1, m.dielectric_f0 = 0.04f, m.normal_scale = 1;
  const TextureSlot none;
  m.base_color_texture = m.metallic_roughness_texture = m.normal_texture = none;
  m.emissive_texture = m.specular_texture = m.specular_color_texture = none;
  return m;
}
inline Material lamp(const Vec3& radiance) {
  Material m = matte(Vec3(0));
  for (int i = 0; i < 3; ++i) m.emissive[i] = radiance[i];
  m.flags = kMaterialEmits;
  m.emission_weight = 0.2126f * radiance.x + 0.7152f * radiance.y + 0.0722f * radiance.z;
  return m;
}

/// A rectangle at `corner` spanned by two edges, as two triangles without attributes.
inline void add_rectangle(TriangleSoup& soup, const Vec3& corner, const Vec3& a, const Vec3& b, uint32_t material) {
  add_triangle(soup, corner, corner + a, corner + a + b, material);
  add_triangle(soup, corner, corner + a + b, corner + b, material);
}

class ShadingScene {
 public:
  ShadingScene(TriangleSoup soup, std::vector<Material> materials, const Affine3& placement = {}) {
    scene.materials = std::move(materials);
    add_emitters(soup, placement);
    MemorySink sink;
    Result<BuiltObject> built = build_object(std::move(soup), {}, nullptr, sink);
    EXPECT_TRUE(built.ok());
    const BuiltObject& object = built.value();
    for (const StoredTreelet& t : sink.treelets)
      geometry.emplace_back(t.geometry), attributes.emplace_back(t.attributes);

    // Node 0 is the tree over the one instance; the object's nodes follow.
    std::vector<TopNode> nodes{empty_top_node(kNoIndex, 0)};
    for (TopNode node : object.nodes) {
      for (int slot = 0; slot < 8; ++slot) {
        if (node.kind[slot] == ChildKind::kNode) node.child[slot] += 1;
      }
      if (node.parent != kNoIndex) node.parent += 1 << 3;
      nodes.push_back(node);
    }
    Instance instance = make_instance({0, placement}, 1, object.bounds);
    set_child(nodes[0], 0, ChildKind::kInstance, 0, world_bounds(instance, object.bounds));
    scene.top_tree = TopTree(std::move(nodes), object.entries, {instance});
  }

  /// Adds a texture of 8-bit RGBA texels, row by row from the top; returns its index. Call before tracing.
  uint32_t add_texture(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba, bool srgb) {
    Texture texture;
    texture.width = width, texture.height = height, texture.level_count = 1, texture.srgb = srgb ? 1 : 0;
    texture.first_page[0] = static_cast<PageId>(tiles_.size());
    for (uint32_t y0 = 0; y0 < height; y0 += kTextureTileTexels) {
      for (uint32_t x0 = 0; x0 < width; x0 += kTextureTileTexels) {
        std::vector<std::byte> tile;
        for (uint32_t y = y0; y < y0 + kTextureTileTexels; ++y) {
          for (uint32_t x = x0; x < x0 + kTextureTileTexels; ++x) {
            const size_t texel = static_cast<size_t>(std::min(y, height - 1)) * width + std::min(x, width - 1);
            for (size_t c = 0; c < 4; ++c) tile.push_back(static_cast<std::byte>(rgba[texel * 4 + c]));
          }
        }
        tiles_.push_back(std::move(tile));
      }
    }
    scene.textures.push_back(texture);
    return static_cast<uint32_t>(scene.textures.size() - 1);
  }

  /// Makes shader and cache; again after a change of the scene or the options.
  void prepare(const ShadingOptions& shading) {
    options = shading;
    auto writer = PageFileWriter::create(files, "tiles");
    ASSERT_TRUE(writer.ok());
    if (tiles_.empty()) tiles_.emplace_back(64, std::byte{0});
    for (const auto& tile : tiles_) ASSERT_TRUE(writer.value().append(PageKind::kTexture, tile).ok());
    ASSERT_TRUE(writer.value().finish().ok());
    shader.reset(), cache.reset();
    auto file = PageFile::open(files, "tiles", ReadMode::kBuffered);
    ASSERT_TRUE(file.ok());
    scene.file = std::move(file).value();
    cache = std::make_unique<PageCache>(*scene.file, cache_bytes);
    auto made = ShadingTables::create(files, scene, options);
    ASSERT_TRUE(made.ok()) << made.error().message;
    tables = std::move(made).value();
    const Sampler sampler(options.sampler, options.seed, 1024, 1024, 1024);
    shader = std::make_unique<Shader>(scene, *tables, options, sampler, *cache);
  }

  Ray trace(const Vec3& origin, const Vec3& direction, float t_max, bool any_hit) const {
    Ray ray = make_ray(origin, direction, t_max, any_hit);
    trace_scene(scene.top_tree, geometry, ray, trace_treelet);
    return ray;
  }

  /// Radiance of one path. Requires: prepare().
  Vec3 radiance(const Vec3& origin, const Vec3& direction, uint32_t pixel, uint32_t sample) {
    PathState path;
    path.pixel = pixel, path.sample = sample;
    path.origin = origin, path.direction = direction;
    for (bool goes_on = true; goes_on;) {
      const Ray ray = trace(path.origin, path.direction, kRayInfinity, false);
      path.hit = ray.hit, path.t = ray.t;
      if (!ray.hit.valid()) {
        shader->shade_miss(path, counters);
        break;
      }
      ShadeResult result;
      EXPECT_TRUE(shader
                      ->shade_hit(path, geometry[ray.hit.treelet].bytes(), attributes[ray.hit.treelet].bytes(),
                                  result, counters, cache_counters)
                      .ok());
      if (result.has_shadow) {
        ++shadow_rays;
        if (!trace(result.shadow_origin, result.shadow_direction, result.shadow_t_max, true).hit.valid()) {
          path.radiance += path.shadow_radiance;
        }
      }
      goes_on = result.has_bounce;
      path.origin = result.bounce_origin, path.direction = result.bounce_direction;
    }
    return path.radiance;
  }
  Vec3 mean_radiance(const Vec3& origin, const Vec3& direction, uint32_t samples) {
    glm::dvec3 sum(0);
    for (uint32_t i = 0; i < samples; ++i) sum += glm::dvec3(radiance(origin, direction, 17, i));
    return Vec3(sum / static_cast<double>(samples));
  }

  Scene scene;
  std::vector<AlignedPage> geometry, attributes;
  MemoryFileSystem files;
  uint64_t cache_bytes = 1 << 20;
  ShadingOptions options;
  std::unique_ptr<ShadingTables> tables;
  std::unique_ptr<PageCache> cache;
  std::unique_ptr<Shader> shader;
  ShadeCounters counters;
  CacheCounters cache_counters;
  uint64_t shadow_rays = 0;

 private:
  void add_emitters(const TriangleSoup& soup, const Affine3& placement) {
    for (size_t i = 0; i < soup.size(); ++i) {
      const Material& material = scene.materials[soup.material[i]];
      if ((material.flags & kMaterialEmits) == 0) continue;
      Emitter e{};
      for (size_t k = 0; k < 3; ++k) {
        const float* corner = soup.positions.data() + 9 * i + 3 * k;
        const Vec3 p = placement.point({corner[0], corner[1], corner[2]});
        e.position[3 * k] = p.x, e.position[3 * k + 1] = p.y, e.position[3 * k + 2] = p.z;
        if (soup.layout.uv_count == 0) continue;
        const float* uv = soup.corners.data() + (3 * i + k) * soup.layout.floats() +
                          soup.layout.uv_offset(material.emissive_texture.uv_set);
        e.uv[2 * k] = uv[0], e.uv[2 * k + 1] = uv[1];
      }
      e.material = soup.material[i], e.primitive = soup.primitive[i];
      scene.emitters.push_back(e);
    }
  }

  std::vector<std::vector<std::byte>> tiles_;
};

}  // namespace shoal::testing
