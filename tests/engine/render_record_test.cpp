// The record of a render: it changes no bit, what it says adds up to the counters, and its trace is whole.
#include "engine/render_record.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "io/page_cache.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/temporary_folder.h"

namespace shoal {
namespace {

using nlohmann::json;

std::string text_of(const MemoryFileSystem& fs, const std::string& name) {
  const std::vector<std::byte> bytes = fs.contents(name);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct TraceEvent {
  std::string name;
  int64_t begin_ns, end_ns;
  json args;
};
using TraceRows = std::map<uint32_t, std::vector<TraceEvent>>;

/// The complete events of a trace, by row. `cut`: as readers take them that cut each number to nanoseconds by itself.
TraceRows rows_of(const json& trace, bool cut = false) {
  TraceRows rows;
  for (const json& event : trace["traceEvents"]) {
    if (event["ph"] != "X") continue;
    const auto ns = [cut](const json& microseconds) {
      const double value = microseconds.get<double>() * 1000;
      return cut ? static_cast<int64_t>(value) : std::llround(value);
    };
    const int64_t begin = ns(event["ts"]);
    rows[event["tid"]].push_back({event["name"], begin, begin + ns(event["dur"]), event.value("args", json::object())});
  }
  return rows;
}

/// Two events of a row lie apart or one inside the other.
void expect_nested(TraceRows rows) {
  for (auto& [row, events] : rows) {
    std::stable_sort(events.begin(), events.end(), [](const TraceEvent& a, const TraceEvent& b) {
      return a.begin_ns != b.begin_ns ? a.begin_ns < b.begin_ns : a.end_ns > b.end_ns;
    });
    std::vector<int64_t> open;
    size_t crossings = 0;
    for (const TraceEvent& event : events) {
      while (!open.empty() && open.back() <= event.begin_ns) open.pop_back();
      crossings += !open.empty() && event.end_ns > open.back() ? 1 : 0;
      open.push_back(event.end_ns);
    }
    EXPECT_EQ(crossings, 0u) << "row " << row << " of " << events.size() << " events";
  }
}

TEST(RenderTimeline, HalvesItselfAndStaysEven) {
  RenderTimeline timeline;
  for (int i = 0; i < 20000; ++i) {
    TimelineSample sample;
    sample.seconds = i * RenderTimeline::kFirstIntervalSeconds;
    timeline.add(sample);
    ASSERT_LE(timeline.samples().size(), RenderTimeline::kCapacity);
  }
  EXPECT_GE(timeline.samples().size(), RenderTimeline::kCapacity / 2);
  EXPECT_EQ(timeline.samples().front().seconds, 0);
  for (size_t i = 1; i < timeline.samples().size(); ++i) {
    const double step = timeline.samples()[i].seconds - timeline.samples()[i - 1].seconds;
    EXPECT_NEAR(step, timeline.interval_seconds(), 0.1 * timeline.interval_seconds()) << i;
  }
}

TEST(TreeletHeat, HasACellForEveryTreeletUntilThereAreTooMany) {
  for (const uint32_t treelets : {0u, 1u, 4095u, 4096u, 4097u, 8192u, 8193u, 1000003u}) {
    TreeletHeat heat(treelets);
    const uint64_t cells = heat.cells().size();
    EXPECT_LE(cells, kHeatCells);
    EXPECT_GE(cells * heat.treelets_a_cell(), treelets);
    if (treelets <= kHeatCells) {
      EXPECT_EQ(heat.treelets_a_cell(), 1u);
    }
    if (treelets == 0) continue;
    EXPECT_LT((cells - 1) * heat.treelets_a_cell(), treelets) << "no cell without a treelet";
    ++heat.of(treelets - 1).loads_count;
    EXPECT_EQ(heat.cells().back().loads_count, 1u);
  }
}

TEST(TraceFile, IsBoundedByTimeWhateverHappensInIt) {
  MemoryFileSystem fs;
  constexpr double kSeconds = 3;
  constexpr unsigned kThreads = 2;
  const TraceClock clock{0, 1e-3};  // a tick is a nanosecond
  auto file = TraceFile::create(fs, "trace.json").value();
  const std::vector<TreeletId> pages(1, 0);
  uint64_t batches = 0, seen = 0;
  for (unsigned t = 0; t < kThreads; ++t) {
    ThreadRecord thread(1, pages, clock, file.get(), t, kThreads);
    PhaseClock phases(0);
    uint64_t now = 0;
    for (uint64_t i = 0; now < kSeconds * 1e9; ++i, ++batches) {
      const uint64_t length = i % 1000 == 0 ? 3000000 : 7000;
      thread.begin_hand(0, now, i, 100 * i);
      phases.enter_at(static_cast<Phase>(i % kPhaseCount), now);
      if (i % 10 == 0) thread.note_wait(0, now + 1000, now + 3000, 100);
      now += length;
      thread.end_hand(now, 64, i + 1, 100 * i + 50);
      if (thread.due(now)) thread.note_progress({}, phases, now);
    }
    thread.finish(phases, now);
  }
  ASSERT_TRUE(file->finish().ok());
  const std::string text = text_of(fs, "trace.json");
  EXPECT_LT(text.size() / kSeconds * 60, 100e6) << batches << " batches";
  const json trace = json::parse(text, nullptr, false);
  ASSERT_TRUE(trace.is_object());
  const TraceRows rows = rows_of(trace);
  expect_nested(rows);
  for (const auto& [row, events] : rows) {
    for (const TraceEvent& event : events) {
      if (event.name == "treelet") ++seen;
      if (event.name == "treelets") seen += event.args["count"].get<uint64_t>();
    }
  }
  EXPECT_EQ(seen, batches) << "what is merged is counted";
}

TEST(TraceFile, LeavesNothingUnlessItIsFinished) {
  MemoryFileSystem fs;
  { const auto file = TraceFile::create(fs, "trace.json").value(); }
  EXPECT_TRUE(fs.names().empty());
}

/// A terrain in treelets of 4 KiB and a cache that is too small for it.
class RenderRecordOf : public ::testing::Test {
 protected:
  void SetUp() override {
    FileSystem& fs = posix_file_system();
    GenerateOptions generate;
    generate.kind = "terrain";
    generate.triangles = 20000;
    generate.out_dir = folder_ / "terrain";
    const auto generated = generate_scene(fs, generate);
    ASSERT_TRUE(generated.ok()) << generated.error().message;
    SceneBuildOptions build;
    build.treelet_bytes = 4096;
    ASSERT_TRUE(build_scene(fs, generated.value().gltf_path, folder_ / "scene.shoal", build).ok());
    auto scene = open_scene(fs, folder_ / "scene.shoal", ReadMode::kDirect, {});
    ASSERT_TRUE(scene.ok()) << scene.error().message;
    scene_ = std::move(scene).value();
    picture_.width = 40, picture_.height = 30, picture_.samples = 2;
  }

  RenderResult rendered(Order order, RenderRecord* record) {
    ExecutionOptions execution;
    execution.order = order;
    execution.threads = 3;
    execution.record = record;
    execution.rays_in_flight = 4000;
    if (order != Order::kHybrid) execution.page_cache_bytes = 384 * 1024;
    auto result = render(posix_file_system(), scene_, picture_, execution);
    EXPECT_TRUE(result.ok()) << result.error().message;
    return result.ok() ? std::move(result).value() : RenderResult{};
  }

  const testing::TemporaryFolder folder_;
  Scene scene_;
  PictureOptions picture_;
};

constexpr Order kOrders[] = {Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid};

TEST_F(RenderRecordOf, AnyOrderAddsUpToItsCountersAndChangesNoBit) {
  const std::vector<float> plain = rendered(Order::kDepthFirst, nullptr).rgba;
  RenderRecord record;
  for (const Order order : kOrders) {
    SCOPED_TRACE(order_name(order));
    const RenderResult result = rendered(order, &record);
    EXPECT_EQ(result.rgba, plain);
    const RenderCourse course = record.take_course();
    HeatCell sum;
    for (const HeatCell& cell : course.heat.cells()) {
      sum.batches_count += cell.batches_count, sum.visits_count += cell.visits_count;
      sum.loads_count += cell.loads_count, sum.load_bytes += cell.load_bytes;
    }
    const RenderCounters& counters = result.counters;
    EXPECT_EQ(course.heat.treelets_count(), scene_.treelets.size());
    EXPECT_EQ(sum.batches_count, counters.treelet_batches_count);
    EXPECT_EQ(sum.loads_count, counters.treelet_loads_count);
    EXPECT_GE(sum.load_bytes, counters.treelet_load_bytes);
    EXPECT_EQ(sum.visits_count, order == Order::kHybrid ? 0 : counters.treelet_visits_count);
    ASSERT_GE(course.timeline.size(), 2u);
    const TimelineSample& last = course.timeline.back();
    EXPECT_EQ(last.disk_read_bytes, counters.disk_read_bytes);
    EXPECT_EQ(last.decoded_bytes, counters.decoded_bytes);
    EXPECT_EQ(last.rays_traced_count, counters.total().rays_traced_count);
    EXPECT_EQ(last.samples_done_count, counters.samples_committed_count);
    EXPECT_EQ(last.paths_in_flight_count, 0u);
    EXPECT_EQ(course.has_queues, order == Order::kQueued);
    for (size_t i = 1; i < course.timeline.size(); ++i) {
      EXPECT_GE(course.timeline[i].seconds, course.timeline[i - 1].seconds);
      EXPECT_GE(course.timeline[i].disk_read_bytes, course.timeline[i - 1].disk_read_bytes);
    }
  }
}

TEST_F(RenderRecordOf, TheTraceOfAnyOrderSumsToItsPhasesAndBatches) {
  for (const Order order : kOrders) {
    SCOPED_TRACE(order_name(order));
    MemoryFileSystem fs;
    RenderRecord record;
    ASSERT_TRUE(record.open_trace(fs, "trace.json").ok());
    const RenderResult result = rendered(order, &record);
    ASSERT_TRUE(record.finish_trace().ok());
    const json trace = json::parse(text_of(fs, "trace.json"), nullptr, false);
    ASSERT_TRUE(trace.is_object());
    const TraceRows rows = rows_of(trace);
    expect_nested(rows);
    expect_nested(rows_of(trace, true));
    std::map<std::string, double> phases;
    uint64_t hands = 0, rays = 0, reads = 0;
    for (const auto& [row, events] : rows) {
      for (const TraceEvent& event : events) {
        if (row < 7 && row % 2 == 1) phases[event.name] += static_cast<double>(event.end_ns - event.begin_ns) * 1e-9;
        if (event.name == "treelet" || event.name == "treelets") {
          hands += event.args.value("count", uint64_t{1});
          rays += event.args["rays"].get<uint64_t>();
        }
        if (event.name == "read" || event.name == "reads") reads += event.args.value("count", uint64_t{1});
      }
    }
    for (size_t i = 0; i < kPhaseCount; ++i) {
      EXPECT_NEAR(phases[std::string(kPhaseNames[i])], result.phases.seconds[i], 0.01 * result.phases.total() + 1e-3)
          << kPhaseNames[i];
    }
    std::map<std::string, size_t> counters;
    for (const json& event : trace["traceEvents"]) {
      if (event["ph"] == "C") ++counters[event["name"]];
    }
    EXPECT_EQ(counters.size(), 5u);
    if (order != Order::kQueued) continue;
    EXPECT_EQ(hands, result.counters.treelet_batches_count);
    EXPECT_EQ(rays, result.counters.treelet_visits_count);
    EXPECT_GT(reads, 0u);
  }
}

TEST_F(RenderRecordOf, AStoppedRenderLeavesAWholeTrace) {
  MemoryFileSystem fs;
  RenderRecord record;
  ASSERT_TRUE(record.open_trace(fs, "trace.json").ok());
  const std::atomic<bool> stop{true};
  RenderHooks hooks;
  hooks.stop = &stop;
  ExecutionOptions execution;
  execution.threads = 2;
  execution.record = &record;
  const auto result = render(posix_file_system(), scene_, picture_, execution, hooks);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kStopped);
  ASSERT_TRUE(record.finish_trace().ok());
  EXPECT_TRUE(json::parse(text_of(fs, "trace.json"), nullptr, false).is_object());
}

}  // namespace
}  // namespace shoal
