// What `shoal compare` leaves in its folder: the page shows what the JSON says, CSV has the same figures, and a browser draws
// every plot without a network and without a complaint.
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "bins/compare_page.h"
#include "tests/bins/browser.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using nlohmann::json;

/// One comparison for all tests, which only look.
class ComparePage : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    expect_exit(run_shoal(*folder_, {"generate", "terrain", "--triangles", "20K", "--out", *folder_ / "terrain"}), 0);
    run_ = new ProgramRun(
        run_shoal(*folder_, {"compare", *folder_ / "terrain/terrain.gltf", "--treelet-size", "4K", "--page-cache", "512K",
                             "--orders", "queued,depth-first,sorted", "--out", *folder_ / "out", "--width", "64", "--height",
                             "48", "--spp", "4", "--threads", "2", "--trace", "--progress", "none"}));
  }
  static void TearDownTestSuite() {
    delete folder_;
    delete run_;
  }
  void SetUp() override {
    expect_exit(*run_, 0);
    html_ = file_text(*folder_ / "out/report.html");
    json_ = json::parse(file_text(*folder_ / "out/compare.json"), nullptr, false);
    ASSERT_TRUE(json_.is_object());
  }
  bool plots() const { return html_.find("class=\"missing\"") == std::string::npos; }
  /// The data of every figure of a kind.
  std::vector<json> specs(const std::string& kind) const {
    std::vector<json> found;
    const std::string mark = "<script type=\"application/json\">", begin = "<figure class=\"" + kind;
    const size_t end = html_.find("id=\"data\"");  // scripts behind it name such figures
    for (size_t at = html_.find(begin); at < end; at = html_.find(begin, at + 1)) {
      const size_t start = html_.find(mark, at) + mark.size();
      found.push_back(json::parse(html_.substr(start, html_.find("</script>", start) - start), nullptr, false));
    }
    return found;
  }

  static TemporaryFolder* folder_;
  static ProgramRun* run_;
  std::string html_;
  json json_;
};

TemporaryFolder* ComparePage::folder_ = nullptr;
ProgramRun* ComparePage::run_ = nullptr;

/// Every cell with a place in the document shows what stands there. Returns how many there are.
size_t expect_shown(const std::string& html, const json& document) {
  const std::vector<std::string> cells = all_matches(html, "<td ([^>]*data-path=[^>]*)>");
  for (const std::string& cell : cells) {
    const json::json_pointer place(between(cell, "data-path=\"", "\""));
    const std::string value = between(cell, "data-value=\"", "\"");
    if (!document.contains(place)) {
      ADD_FAILURE() << "not in compare.json: " << place.to_string();
      continue;
    }
    EXPECT_EQ(std::stod(value), document.at(place).get<double>()) << place.to_string();
  }
  return cells.size();
}

TEST_F(ComparePage, CarriesTheDocumentAndShowsItsNumbers) {
  const json carried = json::parse(between(html_, "<script type=\"application/json\" id=\"data\">", "</script>"), nullptr, false);
  EXPECT_EQ(carried, json_);
  EXPECT_GT(expect_shown(html_, json_), 3 * (18u + 5u + 20u));
  EXPECT_THAT(html_, HasSubstr("3 orders, one picture: every bit of it is the same."));
  EXPECT_TRUE(json_["pictures_identical"].get<bool>());
  EXPECT_THAT(html_, HasSubstr(json_["machine"]["cpu"].get<std::string>()));
  EXPECT_THAT(html_, HasSubstr("--orders queued,depth-first,sorted"));
  for (const json& effect : json_["orders"]["queued"]["effects"]) {
    EXPECT_THAT(html_, HasSubstr("<td>" + effect["name"].get<std::string>() + "</td>"));
  }
}

TEST_F(ComparePage, PlotsHaveTheValuesOfTheDocument) {
  const std::vector<json> all = specs("plot");
  size_t lines = 0;
  for (const json& spec : all) {
    ASSERT_TRUE(spec.is_object());
    if (spec.contains("groups")) continue;
    for (const json& series : spec["series"]) {
      const json& timeline = json_["orders"][series["label"].get<std::string>()]["timeline"];
      EXPECT_EQ(series["x"], timeline["seconds"]);
      size_t same = 0;
      for (const json& column : timeline["columns"]) same += timeline[column["name"].get<std::string>()] == series["y"] ? 1 : 0;
      EXPECT_GE(same, 1u) << series["label"];
      ++lines;
    }
  }
  EXPECT_EQ(lines, 5 * 3u + 2) << "five of every order, two of queues";
  ASSERT_GE(all.size(), 9u);
  const json& bars = all.front();
  for (const json& series : bars["series"]) {
    const json& traffic = json_["orders"][series["label"].get<std::string>()]["traffic"];
    for (size_t i = 0; i < series["x"].size(); ++i) {
      EXPECT_EQ(series["y"][i], traffic[bars["groups"][series["x"][i].get<size_t>()].get<std::string>()]["bytes_per_ray"]);
    }
  }
}

TEST_F(ComparePage, HeatMapsHaveTheCellsOfTheDocument) {
  const std::vector<json> maps = specs("heat");
  ASSERT_EQ(maps.size(), 6u);
  const char* orders[] = {"queued", "depth-first", "sorted"};
  for (size_t i = 0; i < maps.size(); ++i) {
    const json& heat = json_["orders"][orders[i % 3]]["treelet_heat"];
    EXPECT_EQ(maps[i]["cells"], heat[i < 3 ? "loads_count" : "visits_count"]);
    EXPECT_EQ(maps[i]["items"], json_["orders"]["queued"]["scene"]["treelets_count"]);
  }
}

TEST_F(ComparePage, SaysWhichOrdersDoNotCountCrossingsByTreelet) {
  json document = json_;
  for (json& cell : document["orders"]["sorted"]["treelet_heat"]["visits_count"]) cell = 0;
  const auto made = report_html(compare_page(document.dump(), {}));
  ASSERT_TRUE(made.ok());
  const std::string& html = made.value();
  EXPECT_THAT(html, HasSubstr("Not counted by treelet in sorted"));
  EXPECT_THAT(html, HasSubstr("depth-first: crossed by rays"));
  EXPECT_THAT(html, Not(HasSubstr("sorted: crossed by rays")));
  EXPECT_THAT(html_, Not(HasSubstr("Not counted by treelet")));
}

TEST_F(ComparePage, EveryFigureIsInTheCsv) {
  std::map<std::string, std::string> figures;
  std::istringstream lines(file_text(*folder_ / "out/compare.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "order,figure,value");
  while (std::getline(lines, line)) {
    const size_t second = line.find(',', line.find(',') + 1);
    figures[line.substr(0, second)] = line.substr(second + 1);
  }
  for (const auto& [label, order] : json_["orders"].items()) {
    const auto expect = [&](const std::string& name, const json& value) {
      ASSERT_TRUE(figures.contains(label + "," + name)) << name;
      EXPECT_EQ(std::stod(figures[label + "," + name]), value.get<double>()) << name;
    };
    for (const auto& [name, value] : order["counters"]["totals"].items()) expect("counters.totals." + name, value);
    for (const auto& [name, value] : order["phases"]["seconds"].items()) expect("phases.seconds." + name, value);
    for (const auto& [name, level] : order["traffic"].items()) expect("traffic." + name + ".bytes_per_ray", level["bytes_per_ray"]);
    expect("render_seconds", order["render_seconds"]);
  }
  EXPECT_EQ(figures[",pictures_identical"], "true");
  const auto rows_of = [](const std::string& text) { return static_cast<size_t>(std::count(text.begin(), text.end(), '\n')); };
  size_t samples = 1, cells = 1;
  for (const auto& [label, order] : json_["orders"].items()) {
    samples += order["timeline"]["seconds"].size();
    cells += order["treelet_heat"]["loads_count"].size();
  }
  EXPECT_EQ(rows_of(file_text(*folder_ / "out/timeline.csv")), samples);
  EXPECT_EQ(rows_of(file_text(*folder_ / "out/treelets.csv")), cells);
}

TEST_F(ComparePage, TracesOfAllOrdersAreThereAndWhole) {
  for (const char* order : {"queued", "depth-first", "sorted"}) {
    const json trace = json::parse(file_text(*folder_ / (std::string("out/trace-") + order + ".json")), nullptr, false);
    ASSERT_TRUE(trace.is_object()) << order;
    EXPECT_GT(trace["traceEvents"].size(), 20u);
  }
}

TEST_F(ComparePage, IsNamedForTheSceneThatWasAsked) {
  EXPECT_THAT(html_, HasSubstr("<h1>Orders compared: terrain.gltf</h1>"));
  EXPECT_EQ(json_["scene_asked"], *folder_ / "terrain/terrain.gltf");
}

TEST_F(ComparePage, NeedsNothingFromOutside) {
  for (const std::string& source : all_matches(html_, "\\s(?:src|href)=\"([^\"]{0,40})")) {
    EXPECT_TRUE(source.starts_with("data:image/png;base64,")) << source;
  }
  EXPECT_THAT(html_, HasSubstr("default-src 'none'"));
  EXPECT_THAT(html_, Not(HasSubstr("@import")));
  EXPECT_EQ(all_matches(html_, "(<img )").size(), 5u) << "three pictures, two differences";
}

TEST_F(ComparePage, ShowsAModelOfTheCachesAndKindsOfRaysWhereTheDocumentHasThem) {
  json document = json_;
  document["orders"]["queued"]["cache_model"] = {
      {"levels", {{{"name", "L1d"}, {"size_bytes", 32768}, {"ways", 8}, {"accesses_count", 987654}, {"misses_count", 4321}}}},
      {"memory_bytes_per_ray", 12.5}};
  document["ray_kinds"] = {{{"kind", "camera"},
                            {"bounce", 0},
                            {"rays_count", 777},
                            {"orders", {{"queued", {{"mrays_per_second", 1.25}}}, {"sorted", {{"mrays_per_second", 2.5}}}}}}};
  const auto html = report_html(compare_page(document.dump(), {}));
  ASSERT_TRUE(html.ok());
  expect_shown(html.value(), document);
  for (const char* place : {"/orders/queued/cache_model/levels/0/misses_count", "/ray_kinds/0/rays_count",
                            "/ray_kinds/0/orders/queued/mrays_per_second", "/ray_kinds/0/orders/sorted/mrays_per_second"}) {
    EXPECT_THAT(html.value(), HasSubstr("data-path=\"" + std::string(place) + "\"")) << place;
  }
}

/// The page with a look at every canvas at its end: how many colours it has.
std::string with_a_look_at_canvases(std::string html) {
  const std::string look = R"(<script>
document.querySelectorAll("canvas").forEach((canvas) => {
  const pixels = new Uint32Array(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  canvas.dataset.colors = String(new Set(pixels).size);
});
document.documentElement.dataset.paper = getComputedStyle(document.body).backgroundColor;
</script>
)";
  return html.insert(html.rfind("</body>"), look);
}

TEST_F(ComparePage, ABrowserDrawsEveryPlotWithoutAComplaint) {
  if (chromium(*folder_).empty()) GTEST_SKIP() << "no Chromium: neither $SHOAL_CHROMIUM nor one in the path";
  if (!plots()) GTEST_SKIP() << "this program was built without the plotting library";
  put_file(*folder_ / "looked.html", with_a_look_at_canvases(html_));
  const ProgramRun run = open_page(*folder_, *folder_ / "looked.html");
  expect_exit(run, 0);
  ASSERT_THAT(run.out, HasSubstr("</html>")) << run.err;
  EXPECT_THAT(run.err, Not(HasSubstr("CONSOLE"))) << "what the page complained of";
  EXPECT_THAT(all_matches(run.out, "<html[^>]*data-errors=\"([^\"]*)\""), ::testing::IsEmpty());
  const std::vector<std::string> points = all_matches(run.out, "<figure class=\"plot[^>]*data-points=\"([0-9]+)\"");
  EXPECT_EQ(points.size(), 9u);
  EXPECT_EQ(all_matches(run.out, "<figure class=\"plot[^>]*data-drawn=\"([0-9]+)\""), points);
  const std::vector<std::string> cells = all_matches(run.out, "<figure class=\"heat\"[^>]*data-cells=\"([0-9]+)\"");
  EXPECT_EQ(all_matches(run.out, "<figure class=\"heat\"[^>]*data-drawn=\"([0-9]+)\""), cells);
  const std::vector<std::string> colors = all_matches(run.out, "<canvas[^>]*data-colors=\"([0-9]+)\"");
  EXPECT_EQ(colors.size(), points.size() + cells.size());
  for (const std::string& count : colors) EXPECT_GE(std::stoi(count), 3) << "an empty canvas";
}

TEST_F(ComparePage, IsDarkWhereTheSystemAsksForIt) {
  if (chromium(*folder_).empty()) GTEST_SKIP() << "no Chromium: neither $SHOAL_CHROMIUM nor one in the path";
  put_file(*folder_ / "looked.html", with_a_look_at_canvases(html_));
  const ProgramRun run = open_page(*folder_, *folder_ / "looked.html", {"--blink-settings=preferredColorScheme=0"});
  expect_exit(run, 0);
  EXPECT_THAT(run.out, HasSubstr("data-paper=\"rgb(20, 24, 28)\""));
  EXPECT_THAT(run.out, HasSubstr(">light</button>")) << "the button leads to the other";
}

}  // namespace
}  // namespace shoal::testing
