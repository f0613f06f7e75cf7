// The figures of bench/out_of_core, one a file: each prints its table and returns its rows. docs/measuring.md says what
// they show and how to read them. One thread; every render is a process of its own.
#pragma once

#include <string>
#include <vector>

#include "bench/program_runs.h"

namespace shoal::bench {

struct Figure {
  Json json;
  bool ok = true;  ///< what must hold whatever the machine held: pictures are the same, nothing was killed
};

/// Build (when `gltf` is given) and render under a cap, inside memory groups of twice the cap and of exactly the cap.
Figure figure_cap_held(const Setup& setup, const std::string& gltf, uint64_t cap_bytes);

/// Time with a share of the pages in the cache against time with all of them.
Figure figure_quarter(const Setup& setup, double share, bool warm = true);

struct Rivals {
  double share = 0.25;
  std::vector<std::string> scenes;  ///< the same source with other treelet sizes, depth-first
  std::string mapped_pages;         ///< kept or made; empty: in the folder, removed afterwards
  std::vector<std::string> advices = {"normal", "random"};  ///< for mapped pages; none: without that rival
  uint32_t tile_sample = 64;
};
/// Queued against depth-first and against depth-first over memory-mapped pages, all in the same memory.
Figure figure_rivals(const Setup& setup, const Rivals& rivals);

/// Bytes read over bytes of all pages of the scene, by share in the cache and rays in flight.
Figure figure_amplification(const Setup& setup, const std::vector<double>& shares, const std::vector<uint64_t>& rays);

/// Time and bytes by how a cap is split between rays in flight and page cache: the split that is chosen beside `factors`
/// of its paths.
Figure figure_split(const Setup& setup, const std::vector<double>& shares, const std::vector<double>& factors);

struct RandomRays {
  uint64_t rays = 8'000'000, in_flight = 4'000'000;
  double share = 0.25;
  std::string policy = "resident-first";
  uint32_t rays_ahead = 0;  ///< of the policy; 0: its default
};
/// Rays from random places of the whole scene into random directions: what no order of the picture helps with.
Figure figure_random(const Setup& setup, const RandomRays& random);

struct Policies {
  double share = 0.25;
  std::vector<std::string> drains{"resident-first", "fullest", "sweep", "full"};
  std::vector<std::string> evictions{"least-waiting", "least-demand", "least-recent"};
};
/// Every drain policy with every eviction policy, with reads ahead and without.
Figure figure_policies(const Setup& setup, const Policies& policies);

/// Seconds until the first picture of a render with a preview, beside those of reading every page once.
/// `cap_bytes` 0: the program's own choice.
Figure figure_first_picture(const Setup& setup, uint64_t cap_bytes);

/// All of them on a small scene of its own, so that they cannot rot: the figures mean nothing.
Figure figure_check(const Setup& setup);

}  // namespace shoal::bench
