// Cameras and punctual lights.
#include <fmt/format.h>

#include <numbers>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

constexpr double kMaxIntensity = 1e20;  // candela or lux; the product with a colour stays a float

void read_camera(const JsonNode& node, Camera& camera) {
  camera.name = node.text("name");
  const std::string type = node.text("type");
  camera.perspective = type == "perspective";
  if (camera.perspective) {
    const JsonNode lens = node.object("perspective");
    if (!lens.member("yfov").present()) return lens.fail_at("yfov", "an angle", "nothing");
    camera.yfov = lens.number("yfov", camera.yfov);
    if (!(camera.yfov > 0 && camera.yfov < std::numbers::pi)) {
      lens.fail_at("yfov", "an angle above 0 and below pi", fmt::format("{}", camera.yfov));
    }
    camera.aspect_ratio = lens.number("aspectRatio", 0, 0);
  } else if (type == "orthographic") {
    const JsonNode lens = node.object("orthographic");
    camera.xmag = lens.number("xmag", 1);
    camera.ymag = lens.number("ymag", 1);
    if (camera.xmag == 0 || camera.ymag == 0) lens.fail("xmag and ymag other than 0", "0");
  } else {
    node.fail_at("type", "perspective or orthographic", type.empty() ? "nothing" : printable(type));
  }
}

void read_light(const JsonNode& node, Light& light) {
  light.name = node.text("name");
  light.color = node.clamped_numbers<3>("color", {1, 1, 1}, 0, kMaxIntensity);
  light.intensity = node.clamped("intensity", 1, 0, kMaxIntensity);
  light.range = node.clamped("range", 0, 0, kMaxIntensity);
  const std::string type = node.text("type");
  if (type == "directional") {
    light.type = LightType::kDirectional;
  } else if (type == "point") {
    light.type = LightType::kPoint;
  } else if (type == "spot") {
    light.type = LightType::kSpot;
    const JsonNode spot = node.object("spot");
    light.outer_cone = spot.clamped("outerConeAngle", light.outer_cone, 0, std::numbers::pi / 2);
    light.inner_cone = spot.clamped("innerConeAngle", 0, 0, light.outer_cone);
  } else {
    node.fail_at("type", "directional, point or spot", type.empty() ? "nothing" : printable(type));
  }
}

}  // namespace

void read_cameras_and_lights(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode cameras = root.array("cameras", limits.objects_count);
  document.cameras.resize(cameras.size());
  for (uint64_t i = 0; i < cameras.size() && !root.failed(); ++i) {
    read_camera(cameras.object_at(i), document.cameras[i]);
  }
  const JsonNode extension = root.object("extensions").object("KHR_lights_punctual");
  const JsonNode lights = extension.array("lights", limits.objects_count);
  document.lights.resize(lights.size());
  for (uint64_t i = 0; i < lights.size() && !root.failed(); ++i) {
    read_light(lights.object_at(i), document.lights[i]);
  }
}

}  // namespace shoal::gltf
