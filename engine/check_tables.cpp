#include "engine/check_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/build_record.h"
#include "engine/dispersion.h"
#include "engine/mip_pyramid.h"
#include "engine/position_grid.h"
#include "engine/tile_textures.h"
#include "treelets/attribute_layout.h"
#include "treelets/bvh_builder_kind.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_layout.h"

namespace shoal {

namespace {

bool finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

bool finite(const Affine3& a) {
  for (const Vec3& v : {a.column_x, a.column_y, a.column_z, a.translation}) {
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) return false;
  }
  return true;
}

class TableChecker {
 public:
  explicit TableChecker(const Scene& scene) : scene_(scene) {}

  Status run() {
    SHOAL_RETURN_IF_ERROR(header());
    SHOAL_RETURN_IF_ERROR(each("treelets", scene_.treelets, [&](size_t i) { return treelet(i); }));
    SHOAL_RETURN_IF_ERROR(each("textures", scene_.textures, [&](size_t i) { return texture(scene_.textures[i]); }));
    SHOAL_RETURN_IF_ERROR(
        each("materials", scene_.materials, [&](size_t i) { return material(scene_.materials[i]); }));
    SHOAL_RETURN_IF_ERROR(each("material layers", scene_.material_layers,
                               [&](size_t i) { return layers(scene_.material_layers[i]); }));
    SHOAL_RETURN_IF_ERROR(each("texture transforms", scene_.texture_transforms, [&](size_t i) {
      return finite(scene_.texture_transforms[i].m) ? nullptr : "finite numbers";
    }));
    SHOAL_RETURN_IF_ERROR(each("emitters", scene_.emitters, [&](size_t i) { return emitter(i); }));
    SHOAL_RETURN_IF_ERROR(each("lights", scene_.lights, [&](size_t i) { return light(scene_.lights[i]); }));
    SHOAL_RETURN_IF_ERROR(each("camera keys", scene_.camera_keys, [&](size_t i) {
      return finite(scene_.camera_keys[i]) ? nullptr : "finite numbers";
    }));
    return each("cameras", scene_.cameras, [&](size_t i) { return camera(scene_.cameras[i]); });
  }

  Status header() {
    const SceneHeader& h = scene_.header;
    const auto corrupt = [&](const std::string& what) {
      return Error{ErrorCode::kCorrupt, fmt::format("{}: scene header: {}", scene_.file->path(), what)};
    };
    if (h.version != kSceneVersion) {
      return corrupt(fmt::format("version: expected {}, found {}: build the scene again", kSceneVersion, h.version));
    }
    if (!finite(h.bounds_lo) || !finite(h.bounds_hi)) return corrupt("bounds: expected finite numbers");
    const auto known = [&](PositionPrecision p) { return h.position_bits == static_cast<uint32_t>(p); };
    if (std::none_of(std::begin(kPositionPrecisions), std::end(kPositionPrecisions), known) ||
        !(h.position_step >= 0) || !(h.position_error >= 0)) {
      return corrupt(fmt::format("precision of positions: found {} bits, a step of {} and an error of {}", h.position_bits,
                                 h.position_step, h.position_error));
    }
    if (h.bvh_builder >= kBvhBuilders.size()) return corrupt(fmt::format("builder: found {}", h.bvh_builder));
    for (int i = 0; i < 3; ++i) {
      if (h.bounds_lo[i] > h.bounds_hi[i]) return corrupt("bounds: expected lo <= hi");
    }
    return {};
  }

 private:
  /// A row's check returns what is expected, or nullptr.
  template <class T, class Check>
  Status each(const char* table, const std::vector<T>& rows, Check check) {
    for (size_t i = 0; i < rows.size(); ++i) {
      if (const char* expected = check(i)) {
        return Error{ErrorCode::kCorrupt, fmt::format("{}: table of {}, row {} of {}: expected {}",
                                                      scene_.file->path(), table, i, rows.size(), expected)};
      }
    }
    return {};
  }

  bool page_is(uint64_t page, PageKind kind) const {
    return page < scene_.file->page_count() && scene_.file->record(static_cast<PageId>(page)).kind == kind;
  }

  const char* treelet(size_t i) {
    const TreeletPages& t = scene_.treelets[i];
    if (!page_is(t.geometry, PageKind::kTreelet)) return "the id of a geometry page";
    if (i > 0 && t.geometry <= scene_.treelets[i - 1].geometry) return "geometry pages to ascend";
    if (t.attributes != kNoPage &&
        (t.attributes != t.geometry + 1 || !page_is(t.attributes, PageKind::kAttributes))) {
      return "its attribute page to follow its geometry page";
    }
    return nullptr;
  }

  const char* texture(const Texture& t) {
    constexpr uint32_t kMaxSide = 1u << (kMaxTextureLevels - 1);
    if (t.width == 0 || t.height == 0 || t.width > kMaxSide || t.height > kMaxSide)
      return "1 to 65536 texels a side";
    if (t.level_count != full_level_count(t.width, t.height)) return "a full pyramid of levels";
    if (t.wrap_u > WrapMode::kClampToEdge || t.wrap_v > WrapMode::kClampToEdge) return "a known wrap mode";
    if (t.srgb > 1 || t.nearest > 1) return "flags of 0 or 1";
    for (uint32_t l = 0; l < t.level_count; ++l) {
      const uint64_t columns = (level_side(t.width, l) + kTextureTileTexels - 1) / kTextureTileTexels;
      const uint64_t rows = (level_side(t.height, l) + kTextureTileTexels - 1) / kTextureTileTexels;
      for (uint64_t tile = 0; tile < columns * rows; ++tile) {
        if (!page_is(t.first_page[l] + tile, PageKind::kTexture)) return "a texture page for each of its tiles";
      }
    }
    return nullptr;
  }

  const char* slot(const TextureSlot& s) const {
    if (s.texture != kNoIndex && s.texture >= scene_.textures.size()) return "the index of a texture";
    if (s.transform > scene_.texture_transforms.size()) return "the row of a texture transform";
    return s.uv_set < kMaxUvSets ? nullptr : "a uv set below 4";
  }

  const char* layers(const MaterialLayers& l) const {
    for (const TextureSlot* s : texture_slots(l)) {
      if (const char* expected = slot(*s)) return expected;
    }
    for (const float v : {l.transmission, l.clearcoat, l.clearcoat_roughness, l.sheen_color[0], l.sheen_color[1],
                          l.sheen_color[2], l.sheen_roughness, l.anisotropy, l.iridescence, l.diffuse_transmission,
                          l.diffuse_transmission_color[0], l.diffuse_transmission_color[1],
                          l.diffuse_transmission_color[2]}) {
      if (!(v >= 0 && v <= 1)) return "factors in [0, 1]";
    }
    for (const float v : {l.dispersion, l.film_minimum, l.film_maximum, -l.absorption[0], -l.absorption[1],
                          -l.absorption[2]}) {
      if (!(v >= 0) || !std::isfinite(v)) return "finite numbers of the right sign";
    }
    for (const float v : {l.ior, l.iridescence_ior}) {
      if (!(v >= 1 && v <= kLargestIor)) return "an index of refraction from 1 to 1000";
    }
    if (l.volume > 1) return "volume to be 0 or 1";
    const bool turned = std::abs(l.anisotropy_cos) <= 1 && std::abs(l.anisotropy_sin) <= 1;
    return turned && std::isfinite(l.clearcoat_normal_scale) ? nullptr : "a rotation and a finite normal scale";
  }

  const char* material(const Material& m) {
    if (m.coverage > CoverageMode::kBlend) return "a known coverage mode";
    if ((m.flags & ~kAllMaterialFlags) != 0) return "known flags";
    if (m.effects > kAllMaterialEffects) return "known effects";
    if ((m.flags & kMaterialLambert) != 0 && (m.metallic > 0 || m.specular > 0 || m.effects != 0)) {
      return "a Lambert surface to be nothing else";
    }
    if ((m.effects & kEffectUnlit) != 0 && (m.flags & kMaterialEmits) != 0) return "an unlit surface not to emit";
    if ((m.effects & kLayerEffects) != 0 && m.layers >= scene_.material_layers.size()) {
      return "the row of its layers";
    }
    for (const TextureSlot* s : texture_slots(m)) {
      if (const char* expected = slot(*s)) return expected;
    }
    const float unit[] = {m.base_color[0], m.base_color[1], m.base_color[2], m.base_color[3],
                          m.metallic,      m.roughness,     m.specular,      m.dielectric_f0};
    for (const float v : unit) {
      if (!(v >= 0 && v <= 1)) return "factors in [0, 1]";
    }
    const float positive[] = {m.emissive[0],       m.emissive[1],       m.emissive[2],  m.specular_color[0],
                              m.specular_color[1], m.specular_color[2], m.alpha_cutoff, m.emission_weight};
    for (const float v : positive) {
      if (!(v >= 0) || !std::isfinite(v)) return "finite factors that are not negative";
    }
    return std::isfinite(m.normal_scale) ? nullptr : "a finite normal scale";
  }

  const char* emitter(size_t i) {
    const Emitter& e = scene_.emitters[i];
    if (e.material >= scene_.materials.size()) return "the index of a material";
    if (e.instance >= scene_.top_tree.instance_count()) return "the index of an instance";
    if (!finite(e.position)) return "finite positions";
    if (!finite(e.uv)) return "finite uv";
    if (i == 0) return nullptr;
    const Emitter& before = scene_.emitters[i - 1];
    const bool ascends =
        before.instance < e.instance || (before.instance == e.instance && before.primitive < e.primitive);
    return ascends ? nullptr : "ascending (instance, primitive)";
  }

  const char* light(const PunctualLight& l) {
    if (l.type > PunctualType::kSpot) return "a known type";
    const bool numbers = finite(l.position) && finite(l.direction) && finite(l.intensity) &&
                         std::isfinite(l.cos_inner) && std::isfinite(l.cos_outer) && std::isfinite(l.range);
    if (!numbers) return "finite numbers";
    const bool shines = l.intensity[0] >= 0 && l.intensity[1] >= 0 && l.intensity[2] >= 0;
    return shines ? nullptr : "an intensity that is not negative";
  }

  const char* camera(const CameraRecord& c) {
    if (c.perspective > 1) return "perspective to be 0 or 1";
    const bool numbers = finite(c.camera_to_world) && std::isfinite(c.tan_half_yfov) &&
                         std::isfinite(c.aspect_ratio) && std::isfinite(c.xmag) && std::isfinite(c.ymag);
    if (!numbers) return "finite numbers";
    if (c.key_count == 0 && c.first_key == 0) return nullptr;
    const bool there = c.key_count >= 2 && uint64_t{c.first_key} + c.key_count <= scene_.camera_keys.size();
    return there ? nullptr : "two keys at least, in the camera keys";
  }

  const Scene& scene_;
};

}  // namespace

Status check_header(const Scene& scene) { return TableChecker(scene).header(); }

Status check_tables(const Scene& scene) { return TableChecker(scene).run(); }

}  // namespace shoal
