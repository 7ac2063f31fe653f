#include "firmware_host/lab/report/plain_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "firmware_host/lab/report/run_plots.hpp"
#include "firmware_host/lab/report/table.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

constexpr double kWidth = 620;
constexpr double kHeight = 260;
constexpr double kLeft = 62;
constexpr double kTop = 26;
constexpr double kBottom = 34;
constexpr double kRight = 12;
constexpr std::size_t kMostDrawn = 1500;

struct Range {
  double low = 1e300;
  double high = -1e300;

  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void open() {
    if (low > high) *this = {0, 1};
    if (high - low < 1e-12) *this = {low - 0.5, high + 0.5};
  }
};

const char* colourOf(const Series& series, std::size_t i) {
  constexpr std::array<const char*, 6> kColours = {"#1f6fb4", "#d1721a", "#2d8a42",
                                                   "#8552a8", "#b03a3a", "#4a5560"};
  if (series.style == SeriesStyle::kTruth) return "#999999";
  if (series.style == SeriesStyle::kBand) return "#a9c8e6";
  return kColours[i % kColours.size()];
}

/// Converts the plot's units to the drawing's.
class Frame {
 public:
  explicit Frame(const Plot& plot) : logarithmic_(plot.kind == PlotKind::kHistogram) {
    for (const Series& series : plot.series) {
      for (const double x : series.x) x_.add(place(x));
      for (const double y : series.y) {
        y_.add(y);
        if (series.style == SeriesStyle::kBand) y_.add(-y);
      }
    }
    if (plot.kind == PlotKind::kHistogram) y_.add(0);
    x_.open();
    y_.open();
    if (plot.kind == PlotKind::kPlan) equalScales();
  }
  [[nodiscard]] double x(double value) const {
    return kLeft + (place(value) - x_.low) / (x_.high - x_.low) * (kWidth - kLeft - kRight);
  }
  [[nodiscard]] double y(double value) const {
    return kHeight - kBottom - (value - y_.low) / (y_.high - y_.low) * (kHeight - kTop - kBottom);
  }
  [[nodiscard]] std::string axes() const {
    constexpr int kSteps = 4;
    std::string svg;
    for (int i = 0; i <= kSteps; ++i) {
      const double part = static_cast<double>(i) / kSteps;
      const double at_x = x_.low + part * (x_.high - x_.low);
      const double at_y = y_.low + part * (y_.high - y_.low);
      const double left = kLeft + part * (kWidth - kLeft - kRight);
      svg += fmt::format(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{:.3g}</text>)", left,
                         kHeight - kBottom + 14, logarithmic_ ? std::pow(10.0, at_x) : at_x);
      svg += fmt::format(R"(<path d="M{} {:.1f}H{}" stroke="#ddd"/>)", kLeft, y(at_y), kWidth - kRight);
      svg += fmt::format(R"(<text x="{}" y="{:.1f}" text-anchor="end">{:.3g}</text>)", kLeft - 4, y(at_y) + 3,
                         at_y);
    }
    return svg;
  }

 private:
  [[nodiscard]] double place(double x) const { return logarithmic_ ? std::log10(std::max(x, 1e-9)) : x; }
  void equalScales() {
    const double per_x = (x_.high - x_.low) / (kWidth - kLeft - kRight);
    const double per_y = (y_.high - y_.low) / (kHeight - kTop - kBottom);
    Range& shorter = per_x < per_y ? x_ : y_;
    const double wanted = (shorter.high - shorter.low) * std::max(per_x, per_y) / std::min(per_x, per_y);
    const double middle = (shorter.high + shorter.low) / 2;
    shorter = {middle - wanted / 2, middle + wanted / 2};
  }

  bool logarithmic_;
  Range x_;
  Range y_;
};

std::string seriesSvg(const Series& whole, const Frame& frame, const char* colour, bool columns) {
  const Series series = decimated(whole, kMostDrawn);
  std::string path;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const double x = frame.x(series.x[i]);
    const double y = frame.y(series.y[i]);
    if (series.style == SeriesStyle::kPoints) {
      path += fmt::format("M{:.1f} {:.1f}h0", x, y);
    } else if (columns) {
      path += fmt::format("M{:.1f} {:.1f}V{:.1f}", x, frame.y(0), y);
    } else {
      path += fmt::format("{}{:.1f} {:.1f}", i == 0 ? 'M' : 'L', x, y);
    }
  }
  if (series.style == SeriesStyle::kBand) {
    for (std::size_t i = series.x.size(); i-- > 0;) {
      path += fmt::format("L{:.1f} {:.1f}", frame.x(series.x[i]), frame.y(-series.y[i]));
    }
    return fmt::format(R"(<path d="{}Z" fill="{}" fill-opacity="0.5"/>)", path, colour);
  }
  const double width = columns ? 5 : series.style == SeriesStyle::kPoints ? 4 : 1.4;
  return fmt::format(R"(<path d="{}" fill="none" stroke="{}" stroke-width="{}" stroke-linecap="{}"/>)", path,
                     colour, width, columns ? "butt" : "round");
}

std::string runHtml(const ReportedRun& run) {
  const nlohmann::ordered_json json = runDocument(run);
  std::string html = "<h2>" + htmlText(run.view.files.name) + "</h2>\n";
  for (const auto& missing : json["missing"]) {
    html += "<p class=\"missing\">" +
            htmlText(missing["file"].get<std::string>() + ": " + missing["what"].get<std::string>()) +
            "</p>\n";
  }
  std::string group;
  for (const Plot& plot : plotsOf(run.view)) {
    if (plot.group != group) html += "<h3>" + htmlText(plot.group) + "</h3>\n";
    group = plot.group;
    html += svgPlot(plot) + "\n";
  }
  Table health{"health", "Health", {"from [s]", "to [s]", "health"}, {}, false};
  for (const auto& span : json["health"]) {
    health.rows.push_back({shown(span["from"].get<double>()), shown(span["to"].get<double>()),
                           span["health"].get<std::string>()});
  }
  Table events{"events", "Events", {"t [s]", "event", "what"}, {}, true};
  for (const auto& event : json["events"]) {
    events.rows.push_back({fmt::format("{:.3f}", event["t"].get<double>()), event["name"].get<std::string>(),
                           event["text"].get<std::string>()});
  }
  for (const Table& table : {health, events}) html += tableHtml(table);
  for (const Table& table : tablesOf(run.view)) html += tableHtml(table);
  return html;
}

}  // namespace

std::string tableHtml(const Table& table) {
  std::string html = fmt::format("<details{}><summary>{}</summary><table><tr>", table.folded ? "" : " open",
                                 htmlText(table.title));
  for (const std::string& column : table.columns) html += "<th>" + htmlText(column) + "</th>";
  html += "</tr>\n";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (const std::string& cell : row) html += "<td>" + htmlText(cell) + "</td>";
    html += "</tr>\n";
  }
  return html + "</table></details>\n";
}

std::string svgPlot(const Plot& plot) {
  if (plot.kind == PlotKind::kDrawing) {
    return "<figure><figcaption>" + htmlText(plot.title) + "</figcaption>" + plot.svg + "</figure>";
  }
  const Frame frame(plot);
  const std::string unit = plot.kind == PlotKind::kPlan ? ", up: " + plot.y_label
                           : plot.y_label.empty()       ? ""
                                                        : " [" + plot.y_label + "]";
  std::string svg = fmt::format(
      R"(<svg id="{}" viewBox="0 0 {} {}" width="{}" height="{}"><text class="title" x="{}" y="14">{}</text>)",
      htmlText(plot.id), kWidth, kHeight, kWidth, kHeight, kLeft, htmlText(plot.title + unit));
  svg += frame.axes();
  const bool columns = plot.kind == PlotKind::kHistogram;
  double legend = kWidth - kRight;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    if (series.x.empty()) continue;
    const char* colour = colourOf(series, i);
    svg += seriesSvg(series, frame, colour, columns);
    svg += fmt::format(R"(<text x="{:.0f}" y="14" text-anchor="end" fill="{}">{}</text>)", legend, colour,
                       htmlText(series.name));
    constexpr double kLetter = 6.5;
    legend -= kLetter * static_cast<double>(series.name.size() + 2);
  }
  for (const PlotMarker& marker : plot.markers) {
    const double x = frame.x(marker.x);
    if (x < kLeft || x > kWidth - kRight) continue;
    svg += fmt::format(R"(<path d="M{:.1f} {}V{}" stroke="#b03a3a" stroke-dasharray="3 3"/>)", x, kTop,
                       kHeight - kBottom);
  }
  svg += fmt::format(R"(<text x="{}" y="{}" text-anchor="end">{}</text></svg>)", kWidth - kRight, kHeight - 4,
                     htmlText(plot.x_label));
  return svg;
}

std::string htmlDocument(const std::string& title, const std::string& content) {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + htmlText(title) +
         "</title><style>\n"
         "body{font:14px system-ui,sans-serif;margin:1.5em;max-width:1300px}svg text{font:11px "
         "system-ui,sans-serif}svg .title{font-weight:600}table{border-collapse:collapse}td,th{padding:2px "
         "10px;text-align:left;border-bottom:1px solid #ddd}.missing{background:#fff2d8;padding:4px 8px}"
         ".verdict{font-size:17px;font-weight:600}figure{display:inline-block;margin:0 1em 1em "
         "0}figure svg{width:600px;height:auto;display:block}figcaption{font-weight:600}"
         "</style></head><body>\n<h1>" +
         htmlText(title) + "</h1>\n" + content + "<p>" + htmlText(versionText()) + "</p></body></html>\n";
}

std::string plainDocument(const std::string& title, const std::string& content) {
  return htmlDocument(
      title,
      "<p class=\"missing\">This is a plain report: tables and fixed plots, no 3D view. A program "
      "built with npm installed makes the full one.</p>\n" +
          content);
}

std::string plainPage(const std::vector<ReportedRun>& runs) {
  std::string html;
  if (runs.size() == 2) {
    html += "<h2>Differences</h2>\n";
    for (const Table& table : differencesOf(runs[0].view, runs[1].view)) html += tableHtml(table);
  }
  for (const ReportedRun& run : runs) html += runHtml(run);
  return plainDocument("swiftlet report", html);
}

}  // namespace swiftlet
