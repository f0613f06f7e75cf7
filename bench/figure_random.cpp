#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {

Figure figure_random(const Setup& setup, const RandomRays& random) {
  Figure figure;
  const SceneSizes sizes = scene_sizes(setup.scene);
  const auto cache = static_cast<uint64_t>(random.share * static_cast<double>(sizes.treelets_decoded_bytes));
  const RenderRun run = run_command(
      setup, "random",
      {setup.this_program, "random-rays", setup.scene, "--stats", setup.folder + "/random.json", "--rays",
       std::to_string(random.rays), "--in-flight", std::to_string(random.in_flight), "--page-cache",
       std::to_string(cache), "--policy", random.policy, "--rays-ahead",
       std::to_string(random.rays_ahead), "--threads", std::to_string(setup.threads)},
      nullptr);
  if (!run.ok()) give_up("the rays failed: " + run.process.output);
  const double bytes = run.stats["disk_read_bytes"], loaded = run.stats["treelet_load_bytes"];
  const double over_stored = bytes / static_cast<double>(sizes.treelets_stored_bytes);
  const double over_decoded = loaded / static_cast<double>(sizes.treelets_decoded_bytes);
  const double rays = run.stats["rays_traced_count"], seconds = run.stats["seconds"];
  fmt::print("{}: {} treelets, {} decoded, {} stored; {:.0f} % resident, {:.0f} rays, {} in flight\n", setup.scene,
             sizes.treelets_count, format_bytes(sizes.treelets_decoded_bytes),
             format_bytes(sizes.treelets_stored_bytes), 100 * random.share, rays, random.in_flight);
  fmt::print("{:>12} {:>11} {:>11} {:>10} {:>9} {:>10} {:>10}\n", "from disk", "over stored", "over memory",
             "bytes/ray", "seconds", "Mrays/s", "visits/ray");
  fmt::print("{:>12} {:>11.2f} {:>11.2f} {:>10.1f} {:>9.2f} {:>10.3f} {:>10.2f}\n",
             format_bytes(static_cast<uint64_t>(bytes)), over_stored, over_decoded, bytes / rays, seconds,
             rays / seconds * 1e-6, run.stats["treelet_visits_count"].get<double>() / rays);
  figure.json = {{"share", random.share}, {"in_flight", random.in_flight}, {"over_stored", over_stored},
                 {"over_decoded", over_decoded}, {"kernel_disk_read_bytes", run.process.disk_read_bytes},
                 {"stats", run.stats}};
  return figure;
}

}  // namespace shoal::bench
