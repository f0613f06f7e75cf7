#include "engine/record_report.h"

#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

/// Of the render's length, what a rate is over at least: shorter pieces show single reads.
constexpr double kRateShare = 1.0 / 60;
constexpr const char* kRateMeaning = "asked of the disk in the sixtieth of the render, or the sample, before";

// X(name, unit, sentence)
#define SHOAL_HEAT_COLUMNS(X)                                                             \
  X(batches_count, "batches", "treelets of the cell taken in hand")                       \
  X(visits_count, "visits", "rays that crossed treelets of the cell; 0 in order hybrid")  \
  X(loads_count, "pages", "geometry pages of the cell read from disk")                    \
  X(load_bytes, "bytes", "geometry and attribute pages of the cell read, decoded")

Json column(const char* name, const char* unit, const char* sentence) {
  return {{"name", name}, {"unit", unit}, {"meaning", sentence}};
}

std::vector<double> disk_rates(const std::vector<TimelineSample>& samples) {
  std::vector<double> rates;
  const double least = samples.empty() ? 0 : kRateShare * samples.back().seconds;
  size_t from = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    while (from + 1 < i && samples[i].seconds - samples[from + 1].seconds >= least) ++from;
    const double seconds = samples[i].seconds - samples[from].seconds;
    const uint64_t bytes = samples[i].disk_read_bytes - samples[from].disk_read_bytes;
    rates.push_back(seconds > 0 ? static_cast<double>(bytes) / seconds : 0);
  }
  return rates;
}

}  // namespace

std::string timeline_json(const RenderCourse& course) {
  Json columns = Json::array(), lists;
  columns.push_back(column("seconds", "seconds", "since the render began"));
  for (const TimelineSample& sample : course.timeline) lists["seconds"].push_back(sample.seconds);
#define SHOAL_ADD(name, unit, sentence)             \
  columns.push_back(column(#name, unit, sentence)); \
  for (const TimelineSample& sample : course.timeline) lists[#name].push_back(sample.name);
  SHOAL_TIMELINE_COLUMNS(SHOAL_ADD)
#undef SHOAL_ADD
  columns.push_back(column("disk_read_bytes_per_second", "bytes/s", kRateMeaning));
  lists["disk_read_bytes_per_second"] = disk_rates(course.timeline);
  Json json = {{"interval_seconds", course.interval_seconds}, {"has_queues", course.has_queues}, {"columns", columns}};
  json.update(lists);
  return json.dump();
}

std::string heat_json(const RenderCourse& course) {
  Json columns = Json::array(), lists;
#define SHOAL_ADD(name, unit, sentence)             \
  columns.push_back(column(#name, unit, sentence)); \
  for (const HeatCell& cell : course.heat.cells()) lists[#name].push_back(cell.name);
  SHOAL_HEAT_COLUMNS(SHOAL_ADD)
#undef SHOAL_ADD
  Json json = {{"treelets_count", course.heat.treelets_count()},
               {"treelets_a_cell", course.heat.treelets_a_cell()},
               {"columns", columns}};
  json.update(lists);
  return json.dump();
}

}  // namespace shoal
