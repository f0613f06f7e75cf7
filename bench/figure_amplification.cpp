#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {

Figure figure_amplification(const Setup& setup, const std::vector<double>& shares, const std::vector<uint64_t>& rays) {
  Figure figure{Json::array()};
  const SceneSizes sizes = scene_sizes(setup.scene);
  fmt::print("{}: {} treelets, {} of pages decoded, {} stored; {} x {}, {} spp, {} bounces\n", setup.scene,
             sizes.treelets_count, format_bytes(sizes.decoded_bytes), format_bytes(sizes.stored_bytes), setup.width,
             setup.height, setup.samples, setup.bounces);
  fmt::print("{:>9} {:>12} {:>12} {:>11} {:>11} {:>10} {:>12} {:>9}\n", "resident", "in flight", "from disk",
             "over stored", "over memory", "bytes/ray", "rays", "seconds");
  for (const double share : shares) {
    for (const uint64_t in_flight : rays) {
      RenderAsk ask;
      ask.rays_in_flight = in_flight;
      ask.page_cache_bytes = static_cast<uint64_t>(share * static_cast<double>(sizes.decoded_bytes));
      const RenderRun run = run_render(setup, "amplification", ask);
      if (!run.ok()) {
        fmt::print("{:>7.0f} % {:>12} failed: {}\n", 100 * share, in_flight, run.process.output);
        figure.ok = false;
        continue;
      }
      const double bytes = static_cast<double>(run.disk_read_bytes());
      const double traced = static_cast<double>(run.total("rays_traced_count"));
      const double over_stored = bytes / static_cast<double>(sizes.stored_bytes);
      const double over_decoded = bytes / static_cast<double>(sizes.decoded_bytes);
      fmt::print("{:>7.0f} % {:>12} {:>12} {:>11.2f} {:>11.2f} {:>10.1f} {:>12.0f} {:>9.1f}\n", 100 * share, in_flight,
                 format_bytes(run.disk_read_bytes()), over_stored, over_decoded, bytes / traced, traced, run.seconds());
      std::fflush(stdout);
      figure.json.push_back({{"share", share}, {"rays_in_flight", in_flight},
                             {"disk_read_bytes", run.disk_read_bytes()},
                             {"over_stored", over_stored}, {"over_decoded", over_decoded},
                             {"bytes_per_ray", bytes / traced}, {"samples_per_pixel", setup.samples},
                             {"kernel_disk_read_bytes", run.process.disk_read_bytes}, {"stats", run.stats}});
    }
  }
  return figure;
}

}  // namespace shoal::bench
