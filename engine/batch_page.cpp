// summary.html. Its own template, in one file: style, script for sorting, pictures as data. Row by row, so that a batch of
// any size takes the memory of one thumbnail.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "engine/batch_summary.h"
#include "engine/batch_text.h"
#include "engine/render_report.h"
#include "io/base64.h"

namespace shoal {
namespace {

constexpr uint64_t kMaxThumbnailBytes = 1u << 20;

constexpr std::string_view kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Shoal batch</title><style>
/* The colours of reports (bins/report/theme.css). */
:root { color-scheme: light dark; --ink: #1c2126; --dim: #5c6670; --ground: #ffffff; --line: #d9dee3; --head: #f4f6f8;
  --good: #1c7c4a; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e3e8ec; --dim: #98a4ae; --ground: #14181c; --line: #323b43;
  --head: #1c2228; --good: #5fcf94; --bad: #ff8a80; } }
@media print { :root { --ink: #000000; --dim: #444444; --ground: #ffffff; --line: #bbbbbb; --head: #f4f4f4; --good: #1c7c4a; --bad: #b3261e; }
  html { font-size: 9px; } body { margin: 0; } tr { break-inside: avoid; } th { position: static; } }
body { margin: 2rem; background: var(--ground); color: var(--ink);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; } p { margin: .2rem 0; color: var(--dim); } p.bad { color: var(--bad); }
.wide { overflow-x: auto; margin-top: 1rem; } table { border-collapse: collapse; font-size: .85rem; }
th, td { padding: .35rem .7rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { background: var(--head); cursor: pointer; white-space: nowrap; position: sticky; top: 0; }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; } th.n { text-align: right; }
td.done { color: var(--good); } td.failed { color: var(--bad); } td.name { overflow-wrap: anywhere; min-width: 12rem; }
small { color: var(--dim); } small.bad { color: var(--bad); } img { display: block; max-width: 160px; height: auto; }
a { color: inherit; }
</style></head><body>
)";

constexpr std::string_view kTable = R"(<div class="wide"><table><thead><tr><th></th><th>Scene</th><th>State</th>
<th class="n">Code</th><th class="n">Seconds</th><th class="n">Rendering</th><th class="n">Read by the render</th>
<th class="n">Read, written by all</th><th class="n">Rays</th><th class="n">Peak memory</th><th class="n">Triangles</th>
<th>Picture</th><th>Effects</th></tr></thead><tbody>
)";

constexpr std::string_view kTail = R"(</tbody></table></div><script>
document.querySelectorAll("th").forEach((head, column) => head.onclick = () => {
  const body = document.querySelector("tbody"), up = head.dataset.up = head.dataset.up === "1" ? "0" : "1";
  const value = row => row.cells[column].dataset.v ?? row.cells[column].textContent;
  [...body.rows].sort((a, b) => {
    const x = value(a), y = value(b), n = x - y;
    return (up === "1" ? 1 : -1) * (Number.isNaN(n) ? x.localeCompare(y) : n);
  }).forEach(row => body.append(row));
});
</script></body></html>
)";

std::string number_cell(double value, const std::string& text) {
  return fmt::format("<td class=\"n\" data-v=\"{}\">{}</td>", value, text);
}

std::string bytes_cell(uint64_t bytes) { return number_cell(static_cast<double>(bytes), format_bytes(bytes)); }

/// A picture as data, so that the page can be sent on alone; empty when there is none.
std::string thumbnail(FileSystem& fs, const BatchPaths& paths, const BatchScene& scene) {
  const auto png = read_whole_file(fs, paths.thumbnail(scene), kMaxThumbnailBytes);
  if (!png.ok()) return "";
  return fmt::format("<a href=\"{}\"><img alt=\"\" src=\"data:image/png;base64,{}\"></a>",
                     html_address(scene.output + ".png"), encode_base64(std::as_bytes(std::span(png.value()))));
}

std::string row(FileSystem& fs, const BatchPaths& paths, const BatchEntry& entry) {
  const SceneRecord& r = entry.record;
  const SceneFigures& f = r.figures;
  const bool done = r.state == SceneState::kDone, ended = done || r.state == SceneState::kFailed;
  std::string html = "<tr><td>" + (done ? thumbnail(fs, paths, entry.scene) : "") + "</td>";
  html += fmt::format("<td class=\"name\">{}{}{}</td>", html_escape(escape_name(entry.scene.scene)),
                      r.message.empty() ? "" : "<br><small class=\"bad\">" + html_escape(escape_name(r.message)) + "</small>",
                      ended && !entry.scene.error
                          ? fmt::format("<br><small><a href=\"{}\">log</a></small>",
                                        html_address(paths.log(entry.scene).substr(paths.out.size() + 1)))
                          : "");
  html += fmt::format("<td class=\"{}\">{}</td>", state_name(r.state),
                      entry.skipped ? "done before" : state_name(r.state));
  html += ended ? fmt::format("<td class=\"n\">{}</td>", r.exit_code) : "<td></td>";
  html += number_cell(r.seconds, ended ? fmt::format("{:.1f}", r.seconds) : "");
  html += number_cell(f.render_seconds, done ? fmt::format("{:.1f}", f.render_seconds) : "");
  html += done ? bytes_cell(f.disk_read_bytes) : "<td></td>";
  html += ended ? number_cell(static_cast<double>(r.process_disk_read_bytes),
                              format_bytes(r.process_disk_read_bytes) + ", " + format_bytes(r.process_disk_written_bytes))
                : "<td></td>";
  html += number_cell(static_cast<double>(f.rays_count), done ? fmt::format("{}", f.rays_count) : "");
  html += ended ? bytes_cell(done ? f.peak_rss_bytes : r.process_peak_rss_bytes) : "<td></td>";
  html += number_cell(static_cast<double>(f.triangles_count), done ? fmt::format("{}", f.triangles_count) : "");
  html += done ? fmt::format("<td>{} x {}, {} samples<br><small>{}</small></td>", f.width, f.height, f.samples,
                             html_escape(f.order))
               : "<td></td>";
  return html + fmt::format("<td><small>{}</small></td></tr>\n", html_escape(fmt::format("{}", fmt::join(f.effects, ", "))));
}

std::string heading(const BatchStanding& standing) {
  const BatchCounts counts = standing.counts();
  std::string html = fmt::format(
      "<h1>{}</h1><p>{}: {} scenes: {} done, {} done before, {} failed, {} left; {:.0f} s, {} jobs, {} threads, {} in all; "
      "Shoal {}</p>\n",
      html_escape(escape_name(standing.options->folder)), standing.state, counts.scenes, counts.done, counts.skipped,
      counts.failed, counts.left, standing.seconds, standing.options->jobs, standing.threads,
      format_bytes(standing.max_memory_bytes), SHOAL_VERSION);
  for (const std::string& sentence : standing.unreadable) {
    html += fmt::format("<p class=\"bad\">{}</p>\n", html_escape(escape_name(sentence)));
  }
  return html;
}

}  // namespace

Status write_summary_page(FileSystem& fs, const BatchStanding& standing) {
  const BatchPaths paths(standing.options->out);
  SHOAL_ASSIGN_OR_RETURN(AtomicFile page, AtomicFile::create(fs, paths.page()));
  const auto append = [&](std::string_view text) { return page.append(std::as_bytes(std::span(text))); };
  SHOAL_RETURN_IF_ERROR(append(kHead));
  SHOAL_RETURN_IF_ERROR(append(heading(standing)));
  SHOAL_RETURN_IF_ERROR(append(kTable));
  for (const BatchEntry& entry : standing.entries) SHOAL_RETURN_IF_ERROR(append(row(fs, paths, entry)));
  SHOAL_RETURN_IF_ERROR(append(kTail));
  return page.commit();
}

}  // namespace shoal
