// What bench/against_embree prints and writes: a line a row while it runs, and JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "bench/measure_rivals.h"

namespace shoal::bench {

/// What is the same for all rows.
struct RivalScene {
  std::string name;
  uint64_t triangles = 0, treelets = 0;
  uint64_t shoal_bytes = 0;            ///< geometry pages and top tree
  uint64_t mesh_bytes = 0;             ///< vertices and indices, which Embree reads in place
  uint64_t embree_default_bytes = 0, embree_compact_bytes = 0;  ///< without them
  double embree_default_seconds = 0, embree_compact_seconds = 0;  ///< to build
  bool robust = true, cpu_time = false;
};

void print_scene(const RivalScene& scene);
void print_header();
void print_row(const RivalRow& row);

nlohmann::ordered_json to_json(const RivalScene& scene, const RivalRow& row);

}  // namespace shoal::bench
