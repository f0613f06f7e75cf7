#include "engine/surface.h"

#include <cmath>

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

/// Unit length, or zero where there is no direction.
Vec3 unit_or_zero(const DVec3& v) {
  const double scale = std::max(std::abs(v.x), std::max(std::abs(v.y), std::abs(v.z)));
  if (!(scale > 0) || !std::isfinite(scale)) return Vec3(0);
  const DVec3 scaled = v / scale;
  return Vec3(scaled / std::sqrt(glm::dot(scaled, scaled)));
}

template <class T>
T interpolate(const T& c0, const T& c1, const T& c2, float b1, float b2) {
  return c0 + (c1 - c0) * b1 + (c2 - c0) * b2;
}

double determinant(const Affine3& m) {
  return glm::dot(DVec3(m.column_x), glm::cross(DVec3(m.column_y), DVec3(m.column_z)));
}

/// Corner normals, interpolated and taken to world space by the inverse transpose; zero when they are missing.
Vec3 interpolated_normal(const Surface& s, const Instance& instance) {
  const CornerAttributes* c = s.attributes.corner;
  if (c[0].normal == Vec3(0) || c[1].normal == Vec3(0) || c[2].normal == Vec3(0)) return Vec3(0);
  const Vec3 normal = interpolate(c[0].normal, c[1].normal, c[2].normal, s.b1, s.b2);
  return unit_or_zero(instance.identity != 0 ? normal : instance.world_to_object.transposed_vector(normal));
}

void set_tangent(Surface& s, const Instance& instance) {
  const CornerAttributes* c = s.attributes.corner;
  const Vec4 tangent = interpolate(c[0].tangent, c[1].tangent, c[2].tangent, s.b1, s.b2);
  const Vec3 object_tangent(tangent);
  s.tangent = instance.identity != 0 ? object_tangent : instance.object_to_world.vector(object_tangent);
  s.handedness = tangent.w < 0 ? -1.0f : 1.0f;
}

/// Corner tangents. glTF: bitangent = cross(normal, tangent) * w, in object space; a mirroring transform turns it.
TangentFrame corner_tangents(const Surface& s) {
  const Vec3 tangent = unit_or_zero(s.tangent - s.front_normal * glm::dot(s.front_normal, s.tangent));
  return {tangent, glm::cross(s.front_normal, tangent) * (s.mirrored ? -s.handedness : s.handedness)};
}

/// Tangent along +u from dP = (dP/du) du + (dP/dv) dv on two edges. glTF's v runs down the picture and its normal
/// maps have +y up: the bitangent is on the side of -dP/dv (Mikkelsen 2008, section 3, with the two per face).
TangentFrame uv_tangents(const Surface& s, uint32_t uv_set, const float* m) {
  const CornerAttributes* c = s.attributes.corner;
  glm::dvec2 d1 = glm::dvec2(c[1].uv[uv_set]) - glm::dvec2(c[0].uv[uv_set]);
  glm::dvec2 d2 = glm::dvec2(c[2].uv[uv_set]) - glm::dvec2(c[0].uv[uv_set]);
  if (m != nullptr) {
    d1 = {double{m[0]} * d1.x + double{m[1]} * d1.y, double{m[3]} * d1.x + double{m[4]} * d1.y};
    d2 = {double{m[0]} * d2.x + double{m[1]} * d2.y, double{m[3]} * d2.x + double{m[4]} * d2.y};
  }
  const double area = d1.x * d2.y - d2.x * d1.y, sign = area < 0 ? -1 : 1;
  if (area == 0) return {};
  const DVec3 e1 = s.edge1, e2 = s.edge2;
  const Vec3 along_u = unit_or_zero(sign * (e1 * d2.y - e2 * d1.y));
  const Vec3 along_v = unit_or_zero(sign * (e2 * d1.x - e1 * d2.x));
  const Vec3 bitangent = glm::cross(s.front_normal, along_u);
  return {along_u, glm::dot(bitangent, along_v) > 0 ? -bitangent : bitangent};
}

}  // namespace

Vec2 Surface::uv(uint32_t set) const {
  const CornerAttributes* c = attributes.corner;
  return set < 4 ? interpolate(c[0].uv[set], c[1].uv[set], c[2].uv[set], b1, b2) : Vec2(0);
}

Vec4 Surface::color() const {
  const CornerAttributes* c = attributes.corner;
  return interpolate(c[0].color, c[1].color, c[2].color, b1, b2);
}

Surface find_surface(const PathState& path, const Instance& instance, std::span<const std::byte> geometry,
                     std::span<const std::byte> attributes, TriangleTest test) {
  Surface s;
  const TreeletTriangle triangle = find_triangle(geometry, path.hit.slot);
  Ray ray;
  ray.origin = path.origin, ray.direction = path.direction, ray.t = path.t;
  ray.hit = path.hit;
  const TrianglePoint at = intersect_known(ray, instance, triangle, test);
  s.b1 = at.b1, s.b2 = at.b2;
  if (!attributes.empty()) s.attributes = find_attributes(attributes, triangle.ordinal);
  if (triangle.material != kNoIndex) s.attributes.material = triangle.material;

  s.position = to_world(point_on_triangle(triangle.p0, triangle.p1, triangle.p2, s.b1, s.b2), instance);
  s.wo = unit_or_zero(-DVec3(path.direction));
  s.edge1 = triangle.p1 - triangle.p0, s.edge2 = triangle.p2 - triangle.p0;
  if (instance.identity == 0) {
    s.edge1 = instance.object_to_world.vector(s.edge1), s.edge2 = instance.object_to_world.vector(s.edge2);
    s.mirrored = determinant(instance.object_to_world) < 0;
  }
  // The front is where corners run counter-clockwise; a mirroring transform turns their order (glTF 2.0, 3.7.4).
  const Vec3 ccw = unit_or_zero(glm::cross(DVec3(s.edge1), DVec3(s.edge2)));
  const Vec3 face = s.mirrored ? -ccw : ccw;
  s.geometric_normal = glm::dot(ccw, s.wo) < 0 ? -ccw : ccw;
  s.front_normal = interpolated_normal(s, instance);
  if (s.front_normal == Vec3(0)) s.front_normal = face;
  set_tangent(s, instance);
  s.front = glm::dot(s.front_normal, s.geometric_normal) >= 0;
  return s;
}

TangentFrame tangent_frame(const Surface& s, uint32_t uv_set, const float* uv_transform) {
  if (s.tangent != Vec3(0)) return corner_tangents(s);
  return uv_set < 4 ? uv_tangents(s, uv_set, uv_transform) : TangentFrame{};
}

Vec3 map_normal(const Surface& s, const Vec3& n, uint32_t uv_set, const float* uv_transform) {
  const TangentFrame frame = tangent_frame(s, uv_set, uv_transform);
  if (frame.tangent == Vec3(0)) return s.front_normal;
  const Vec3 mapped = unit_or_zero(frame.tangent * n.x + frame.bitangent * n.y + s.front_normal * n.z);
  return mapped == Vec3(0) ? s.front_normal : mapped;
}

Vec3 facing_normal(const Surface& s, const Vec3& front_normal) {
  const Vec3 normal = s.front ? front_normal : -front_normal;
  const float seen = glm::dot(normal, s.wo), flat = glm::dot(s.geometric_normal, s.wo);
  const float least = kMinViewRatio * flat;
  if (seen >= least) return normal;
  const float lean = (least - seen) / (flat - seen);  // in [0, 1], as seen < least <= flat
  const Vec3 leaned = unit_or_zero((1 - lean) * normal + lean * s.geometric_normal);
  return leaned == Vec3(0) ? s.geometric_normal : leaned;
}

}  // namespace shoal
