// The page that `shoal accuracy` writes: what it shows is what the JSON says, it needs nothing from outside, and a browser
// draws it without a complaint. The browser is Chromium where the machine has one ($SHOAL_CHROMIUM, or by its usual names);
// else that test skips itself and says so.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/bins/browser.h"
#include "tests/bins/small_scene.h"
#include "tests/support/white_box.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using nlohmann::json;

class ReportPage : public ::testing::Test {
 protected:
  void SetUp() override {
    save(white_box(), folder_ / "");
    expect_exit(run_shoal(folder_, {"accuracy", folder_ / "scene.gltf", "--out", folder_ / "out", "--width", "40",
                                    "--height", "30", "--spp", "2", "--reference-spp", "64", "--budget", "none",
                                    "--environment", "constant:1,1,1", "--knobs", "samples,bounces", "--progress", "none"}),
                0);
    html_ = file_text(folder_ / "out/report.html");
    json_ = json::parse(file_text(folder_ / "out/accuracy.json"), nullptr, false);
    ASSERT_TRUE(json_.is_object());
  }
  bool plots() const { return html_.find("class=\"missing\"") == std::string::npos; }

  const TemporaryFolder folder_;
  std::string html_;
  json json_;
};

TEST_F(ReportPage, CarriesTheDocumentAndShowsItsNumbers) {
  const json carried = json::parse(between(html_, "<script type=\"application/json\" id=\"data\">", "</script>"), nullptr, false);
  EXPECT_EQ(carried, json_);
  const std::string table = between(html_, "<tbody>", "</tbody>");
  const std::vector<std::string> rows = all_matches(table, "<tr[^>]*>([^\\n]*)</tr>");
  ASSERT_EQ(rows.size(), json_["rows"].size());
  const char* columns[] = {"render_seconds", "build_seconds", "disk_read_bytes", "file_bytes_per_triangle", "rel_mse",
                           "flip",           "variance",      "bias_squared",    "efficiency"};
  for (size_t i = 0; i < rows.size(); ++i) {
    EXPECT_THAT(rows[i], HasSubstr("<td>" + json_["rows"][i]["name"].get<std::string>() + "</td>"));
    const std::vector<std::string> shown = all_matches(rows[i], "data-value=\"([^\"]*)\"");
    ASSERT_EQ(shown.size(), std::size(columns)) << rows[i];
    for (size_t c = 0; c < shown.size(); ++c) {
      EXPECT_EQ(std::stod(shown[c]), json_["rows"][i][columns[c]].get<double>()) << columns[c];
    }
  }
}

TEST_F(ReportPage, PlotsHaveTheRowsOfTheDocument) {
  const std::vector<std::string> specs = all_matches(html_, "</div>\\n<script type=\"application/json\">([^\\n]*)</script></figure>");
  ASSERT_EQ(specs.size(), 2u);
  const char* measures[] = {"rel_mse", "flip"};
  for (size_t p = 0; p < specs.size(); ++p) {
    const json spec = json::parse(specs[p], nullptr, false);
    std::map<std::string, std::pair<double, double>> points;
    for (const json& series : spec["series"]) {
      for (size_t i = 0; i < series["x"].size(); ++i) points[series["names"][i]] = {series["x"][i], series["y"][i]};
    }
    ASSERT_EQ(points.size(), json_["rows"].size());
    for (const json& row : json_["rows"]) {
      const std::pair<double, double> expected(row["render_seconds"], row[measures[p]]);
      EXPECT_EQ(points[row["name"]], expected) << row["name"];
    }
    const json& front = spec["series"].back();
    EXPECT_TRUE(front["front"]);
    if (p > 0) continue;
    size_t on_front = 0;
    for (const json& row : json_["rows"]) on_front += row["pareto"].get<bool>();
    EXPECT_EQ(front["x"].size(), on_front);
  }
}

TEST_F(ReportPage, NeedsNothingFromOutside) {
  for (const std::string& source : all_matches(html_, "\\s(?:src|href)=\"([^\"]{0,40})")) {
    EXPECT_TRUE(source.starts_with("data:image/png;base64,")) << source;
  }
  EXPECT_THAT(html_, HasSubstr("default-src 'none'"));
  EXPECT_THAT(html_, Not(HasSubstr("@import")));
  EXPECT_THAT(html_, Not(HasSubstr("url(")));
  EXPECT_GT(all_matches(html_, "(<img )").size(), 6u);
}

TEST_F(ReportPage, EverySentenceOfTheDocumentIsThere) {
  for (const json& sentence : json_["sentences"]) EXPECT_THAT(html_, HasSubstr(sentence["text"].get<std::string>()));
  EXPECT_THAT(html_, HasSubstr("@media print"));
  EXPECT_THAT(html_, HasSubstr("prefers-color-scheme: dark"));
}

TEST_F(ReportPage, ABrowserDrawsEveryPlotWithoutAComplaint) {
  if (chromium(folder_).empty()) GTEST_SKIP() << "no Chromium: neither $SHOAL_CHROMIUM nor one in the path";
  if (!plots()) GTEST_SKIP() << "this program was built without the plotting library";
  const ProgramRun run = open_page(folder_, folder_ / "out/report.html");
  expect_exit(run, 0);
  ASSERT_THAT(run.out, HasSubstr("</html>")) << run.err;
  EXPECT_THAT(run.err, Not(HasSubstr("CONSOLE"))) << "what the page complained of";
  EXPECT_THAT(all_matches(run.out, "<html[^>]*data-errors=\"([^\"]*)\""), ::testing::IsEmpty());
  const std::vector<std::string> points = all_matches(run.out, "<figure class=\"plot\" data-points=\"([0-9]+)\"");
  EXPECT_EQ(points.size(), 2u);
  EXPECT_EQ(all_matches(run.out, "<figure class=\"plot\"[^>]*data-drawn=\"([0-9]+)\""), points);
  EXPECT_EQ(all_matches(run.out, "(<canvas)").size(), points.size());
}

}  // namespace
}  // namespace shoal::testing
