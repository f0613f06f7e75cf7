// Materials with one layer each and with several, for tests of the layered BSDF, and the tables that they need.
// Header only; for targets that link the engine.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "engine/layered_bsdf.h"
#include "engine/sampler.h"

namespace shoal::testing {

inline const LobeTables& lobe_tables() {
  static const EnergyTable energy;
  static const GlassTable glass({1.05f, 1.1f, 1.2f, 1.33f, 1.4f, 1.5f, 2.2f, 2.4f});
  static const SheenTable sheen;
  static const AnisotropyTable anisotropy;
  static const LobeTables tables{&energy, &glass, &sheen, &anisotropy};
  return tables;
}

inline constexpr Vec3 kUp(0, 0, 1);

/// A unit vector at a cosine and an azimuth to kUp.
inline Vec3 view(float mu, float phi = 0.6f) {
  const float sine = std::sqrt(1 - mu * mu);
  return {sine * std::cos(phi), sine * std::sin(phi), mu};
}

struct LayeredCase {
  std::string name;
  LayeredSample material;
};

inline LayeredSample white_plastic(float roughness) {
  LayeredSample m;
  m.roughness = roughness;
  m.clearcoat_normal = {0, 0, 1};
  m.anisotropy_direction = {1, 0, 0};
  return m;
}
inline LayeredSample white_metal(float roughness) {
  LayeredSample m = white_plastic(roughness);
  m.metallic = 1;
  return m;
}
inline LayeredSample white_glass(float roughness, float ior, bool outside) {
  LayeredSample m = white_plastic(roughness);
  m.transmission = 1, m.volume = true, m.outside = outside, m.ior = ior;
  const float r = (ior - 1) / (ior + 1);
  m.dielectric_f0 = r * r;
  return m;
}

/// One material a lobe, and mixtures; white, at this roughness.
inline std::vector<LayeredCase> layered_cases(float roughness) {
  std::vector<LayeredCase> cases;
  const auto add = [&](const char* name, const LayeredSample& m) { cases.push_back({name, m}); };
  add("plastic", white_plastic(roughness));
  LayeredSample m = white_plastic(roughness);
  m.transmission = 1;
  add("thin", m);
  m.transmission = 0.5f, m.roughness = roughness, m.ior = 1.2f;
  add("half thin", m);
  add("glass from outside", white_glass(roughness, 1.5f, true));
  add("glass from inside", white_glass(roughness, 1.5f, false));
  m = white_glass(roughness, 2.4f, true), m.transmission = 0.6f, m.diffuse_transmission = 0.5f;
  add("part glass", m);
  m = white_glass(roughness, 1.0f, true);
  add("volume that bends nothing", m);
  m = white_glass(roughness, 1.33f, false), m.specular = 0;
  add("glass without specular", m);
  m = white_plastic(roughness), m.diffuse_transmission = 0.7f;
  add("paper", m);
  m = white_metal(roughness), m.anisotropy = 0.8f;
  add("brushed", m);
  m = white_metal(0.5f), m.clearcoat = 1, m.clearcoat_roughness = roughness;
  add("coated metal", m);
  m.clearcoat_normal = glm::normalize(Vec3(0.3f, 0.2f, 1));
  add("coat with a normal of its own", m);
  m = white_plastic(roughness), m.anisotropy = 0.6f;
  add("brushed plastic", m);
  m = white_glass(0.4f, 1.5f, true), m.clearcoat = 1, m.clearcoat_roughness = roughness;
  add("coated glass", m);
  m = white_plastic(0.8f), m.sheen_color = Vec3(1), m.sheen_roughness = roughness;
  add("velvet", m);
  m.diffuse_transmission = 0.6f, m.clearcoat = 0.5f, m.clearcoat_roughness = 0.3f;
  add("coated velvet curtain", m);
  m = white_glass(roughness, 1.5f, true), m.iridescence = 1, m.film_thickness = 420;
  add("soapy glass", m);
  m = white_plastic(roughness), m.iridescence = 1, m.film_thickness = 350, m.base_color = Vec3(1);
  add("soap", m);
  m = white_metal(roughness), m.iridescence = 1, m.film_thickness = 500, m.base_color = {0.9f, 0.6f, 0.3f};
  add("tempered steel", m);
  m = white_plastic(roughness);
  m.metallic = 0.3f, m.clearcoat = 0.7f, m.clearcoat_roughness = 0.2f, m.sheen_color = {0.2f, 0.9f, 0.5f};
  m.sheen_roughness = 0.4f, m.anisotropy = 0.5f, m.iridescence = 0.5f, m.film_thickness = 300;
  m.transmission = 0.4f, m.diffuse_transmission = 0.3f, m.base_color = {1, 0.8f, 0.6f};
  add("everything", m);
  m.volume = true;
  add("everything in a volume", m);
  return cases;
}

inline BsdfSample draw(const LayeredBsdf& bsdf, uint32_t i, uint32_t stream) {
  const Random4 r = random4(99, i, stream, 0, Dimension::kBsdf);
  return bsdf.sample(r.uniform(0), r.uniform(1), r.uniform(2));
}

}  // namespace shoal::testing
