#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {

Figure figure_policies(const Setup& setup, const Policies& policies) {
  Figure figure{Json::array()};
  const uint64_t cap = cap_for_share(setup, policies.share);
  RenderRun first;
  fmt::print("{}: cap {}, {:.0f} % of the pages in the cache\n", setup.scene, format_bytes(cap), 100 * policies.share);
  fmt::print("{:<16} {:<14} {:<11} {:>9} {:>12} {:>10} {:>12}\n", "drain", "eviction", "reads ahead", "seconds",
             "from disk", "bytes/ray", "visits/batch");
  for (const std::string& drain : policies.drains) {
    for (const std::string& eviction : policies.evictions) {
      for (const bool ahead : {true, false}) {
        RenderAsk ask;
        ask.max_memory_bytes = cap;
        ask.more = {"--policy", drain, "--eviction", eviction};
        if (!ahead) ask.more.insert(ask.more.end(), {"--read-depth", "0"});
        std::vector<double> seconds;
        RenderRun run;
        for (uint32_t i = 0; i < setup.runs; ++i) {
          run = run_render(setup, figure.json.empty() ? "policy-first" : "policy", ask);
          if (!run.ok()) break;
          seconds.push_back(run.seconds());
        }
        if (figure.json.empty()) first = run;
        if (!run.ok() || !same_picture(setup, first, run)) {
          fmt::print("{:<16} {:<14} {:<11} failed or another picture: {}\n", drain, eviction, ahead ? "yes" : "no",
                     run.process.output);
          figure.ok = false;
          continue;
        }
        const auto per = [&](const char* a, const char* b) {
          return static_cast<double>(run.total(a)) / static_cast<double>(run.total(b));
        };
        fmt::print("{:<16} {:<14} {:<11} {:>9.2f} {:>12} {:>10.1f} {:>12.1f}\n", drain, eviction, ahead ? "yes" : "no",
                   median(seconds), format_bytes(run.disk_read_bytes()), per("disk_read_bytes", "rays_traced_count"),
                   per("treelet_visits_count", "treelet_batches_count"));
        std::fflush(stdout);
        figure.json.push_back({{"drain", drain}, {"eviction", eviction}, {"reads_ahead", ahead},
                               {"median_seconds", median(seconds)}, {"seconds", seconds}, {"stats", run.stats}});
      }
    }
  }
  return figure;
}

}  // namespace shoal::bench
