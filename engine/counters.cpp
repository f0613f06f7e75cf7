#include "engine/counters.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const RayCounters& counters) {
  Json json;
#define SHOAL_PUT(name, unit, sentence) json[#name] = counters.name;
  SHOAL_RAY_COUNTERS(SHOAL_PUT)
  return json;
}

Status expect_equal(std::string_view left_name, uint64_t left, std::string_view right_name, uint64_t right) {
  if (left == right) return {};
  return Error{ErrorCode::kInternal, fmt::format("counters do not balance: {} = {} but {} = {}", left_name, left,
                                                 right_name, right)};
}

}  // namespace

void RayCounters::add(const RayCounters& other) {
#define SHOAL_ADD(name, unit, sentence) name += other.name;
  SHOAL_RAY_COUNTERS(SHOAL_ADD)
}

void RenderCounters::add(const RenderCounters& other) {
  SHOAL_RENDER_COUNTERS(SHOAL_ADD)
#undef SHOAL_ADD
  for (size_t kind = 0; kind < rays.size(); ++kind) {
    for (size_t bounce = 0; bounce < kCountedBounces; ++bounce) rays[kind][bounce].add(other.rays[kind][bounce]);
  }
  first_invalid = std::min(first_invalid, other.first_invalid);
}

void RenderCounters::take(const InvalidSamples& invalid) {
  invalid_samples_count += invalid.total();
  invalid_emission_count += invalid.of(InvalidTerm::kEmission);
  invalid_environment_count += invalid.of(InvalidTerm::kEnvironment);
  invalid_light_count += invalid.of(InvalidTerm::kLight);
  invalid_surface_count += invalid.of(InvalidTerm::kSurface);
  invalid_bounce_count += invalid.of(InvalidTerm::kBounce);
  invalid_path_count += invalid.of(InvalidTerm::kPath);
  first_invalid = std::min(first_invalid, invalid.first);
}

RayCounters RenderCounters::total() const {
  RayCounters sum;
  for (const auto& kind : rays) {
    for (const RayCounters& bounce : kind) sum.add(bounce);
  }
  return sum;
}

RayCounters RenderCounters::of_kind(RayKind kind) const {
  RayCounters sum;
  for (const RayCounters& bounce : rays[static_cast<size_t>(kind)]) sum.add(bounce);
  return sum;
}

RayCounters RenderCounters::of_bounce(uint32_t bounce) const {
  RayCounters sum;
  for (const auto& kind : rays) sum.add(kind[bounce]);
  return sum;
}

std::vector<CounterInfo> counter_list() {
  std::vector<CounterInfo> list;
#define SHOAL_LIST(name, unit, sentence) list.push_back({#name, unit, sentence});
  SHOAL_RENDER_COUNTERS(SHOAL_LIST)
  SHOAL_RAY_COUNTERS(SHOAL_LIST)
#undef SHOAL_LIST
  return list;
}

Status check_traffic_identities(const RenderCounters& c, uint64_t samples_expected) {
  const RayCounters rays = c.total();
  SHOAL_RETURN_IF_ERROR(expect_equal("page_requests_count", c.page_requests_count, "hits + misses",
                                     c.page_hits_count + c.page_misses_count));
  SHOAL_RETURN_IF_ERROR(expect_equal("misses + prefetches", c.page_misses_count + c.page_prefetches_count, "loads of treelets, attributes, textures",
                                     c.treelet_loads_count + c.attribute_loads_count + c.texture_loads_count));
  SHOAL_RETURN_IF_ERROR(expect_equal("rays_queued_count", rays.rays_queued_count, "rays_drained_count",
                                     rays.rays_drained_count));
  SHOAL_RETURN_IF_ERROR(expect_equal("rays_traced_count", rays.rays_traced_count, "rays_finished_count",
                                     rays.rays_finished_count));
  SHOAL_RETURN_IF_ERROR(expect_equal("rays_finished_count", rays.rays_finished_count, "hits + misses",
                                     rays.ray_hits_count + rays.ray_misses_count));
  SHOAL_RETURN_IF_ERROR(expect_equal("samples_started_count", c.samples_started_count, "samples_committed_count",
                                     c.samples_committed_count));
  return expect_equal("samples_committed_count", c.samples_committed_count, "samples asked for", samples_expected);
}

Status check_identities(const RenderCounters& c, uint64_t samples_expected) {
  SHOAL_RETURN_IF_ERROR(check_traffic_identities(c, samples_expected));
  const RayCounters camera = c.of_kind(RayKind::kCamera);
  SHOAL_RETURN_IF_ERROR(
      expect_equal("camera rays_traced_count", camera.rays_traced_count, "samples asked for", samples_expected));
  SHOAL_RETURN_IF_ERROR(expect_equal("invalid_samples_count", c.invalid_samples_count, "the sum of its terms",
                                     c.invalid_emission_count + c.invalid_environment_count + c.invalid_light_count +
                                         c.invalid_surface_count + c.invalid_bounce_count + c.invalid_path_count));
  if (c.simd_active_lanes_count > c.simd_lanes_count) {
    return Error{ErrorCode::kInternal, fmt::format("counters do not balance: {} active lanes of {} lanes",
                                                   c.simd_active_lanes_count, c.simd_lanes_count)};
  }
  const uint64_t vertices =
      c.of_kind(RayKind::kCamera).ray_hits_count + c.of_kind(RayKind::kBounce).ray_hits_count;
  return expect_equal("vertices_shaded_count", c.vertices_shaded_count, "hits of camera and bounce rays", vertices);
}

std::string counters_json(const RenderCounters& counters) {
  Json totals;
#define SHOAL_PUT_TOTAL(name, unit, sentence) totals[#name] = counters.name;
  SHOAL_RENDER_COUNTERS(SHOAL_PUT_TOTAL)
#undef SHOAL_PUT_TOTAL
  const RayCounters rays = counters.total();
  Json json;
  totals.update(to_json(rays));
  json["totals"] = totals;
  for (size_t kind = 0; kind < kRayKindNames.size(); ++kind) {
    json["by_kind"][std::string(kRayKindNames[kind])] = to_json(counters.of_kind(static_cast<RayKind>(kind)));
  }
  json["by_bounce"] = Json::array();
  for (uint32_t bounce = 0; bounce < kCountedBounces; ++bounce) {
    const RayCounters sum = counters.of_bounce(bounce);
    if (sum.rays_traced_count == 0) continue;
    Json row = to_json(sum);
    row["bounce"] = bounce;
    json["by_bounce"].push_back(row);
  }
  return json.dump();
}

}  // namespace shoal
