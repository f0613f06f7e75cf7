// What a finished render leaves: the picture as EXR (and PNG), the `--stats` JSON, and the traffic table for people.
// Called by bins. Plain functions.
#pragma once

#include <string>
#include <vector>

#include "engine/effects.h"
#include "engine/render.h"
#include "io/image.h"

namespace shoal {

/// R,G,B,A as float with the attributes of docs/design.md: software, renderTimeSeconds, samplesPerPixel, worldToCamera,
/// worldToNDC.
ExrImage picture_image(const RenderResult& result, const Scene& scene, const PictureOptions& picture);

/// Without channels: the attributes that follow from scene and options.
ExrImage described_image(const Scene& scene, const PictureOptions& picture);
/// Adds R, G, B, A and the layers.
void add_channels(const std::vector<float>& rgba, const std::vector<ExrChannel>& layers, ExrImage& image);

/// What of the options asks for effects.
EffectAskers effect_askers(const PictureOptions& picture);

/// The `--stats` document (schema version, options, machine, memory plan, counters), JSON text.
std::string stats_json(const RenderResult& result, const Scene& scene, const PictureOptions& picture,
                       const ExecutionOptions& execution);

/// Processor, memory and system as that document has them, JSON text.
std::string machine_description();

/// What of a picture `width` pixels wide was not a number, or too large for the film, a sentence each: of which terms, and
/// where first. Empty of nearly all pictures.
std::vector<std::string> number_warnings(const RenderCounters& counters, uint32_t width);

/// One column of the traffic table.
struct TrafficColumn {
  std::string title;
  const RenderResult* result;
};
/// Bytes from disk, loads, rays a load, visits a ray, time: one row a figure, one column a render.
std::string traffic_table(const std::vector<TrafficColumn>& columns);

/// "12.3 MiB": binary units, three digits.
std::string format_bytes(uint64_t bytes);

}  // namespace shoal
