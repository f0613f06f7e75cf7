// Painted textures for generated scenes: a function of uv sampled at texel centres, written as a PNG. Called by
// engine/generate_*. Cost: one call of the function a texel, in parallel.
#pragma once

#include <functional>
#include <string>

#include "engine/generate_kinds.h"
#include "treelets/vector.h"

namespace shoal {

/// uv in (0, 1), v down, to stored RGBA in [0, 1] (sRGB-encoded where the texture is a colour). Pure.
using Paint = std::function<Vec4(float u, float v)>;

/// Writes `<out_dir>/<name>` and adds its bytes to the report. Fails with: kStorage.
Status write_texture(const GenerateContext& context, const std::string& name, uint32_t width, uint32_t height,
                     const Paint& paint, GenerateReport& report);

/// A normal map's texel from the slopes of a height field, du and dv in height a unit of uv.
Vec4 normal_texel(double slope_u, double slope_v);

/// A twig of pointed leaves on a clear ground: for alpha masks.
Vec4 paint_leaves(float u, float v);
/// A frond with soft edges: for alpha blending.
Vec4 paint_frond(float u, float v);
/// A sea fan: a net of branching ribs.
Vec4 paint_sea_fan(float u, float v, uint32_t seed);
Vec4 paint_marble(float u, float v, uint32_t seed);
/// Light seen through open water, over sea_dome: brightest ahead.
Vec4 paint_sea(float u, float v);
/// Pale; alpha is what a rippled surface keeps of the sunlight, with bright lines where it gathers it.
Vec4 paint_caustics(float u, float v, uint32_t seed);

}  // namespace shoal
