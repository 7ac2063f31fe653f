#include "firmware_host/lab/report/plot.hpp"

#include <algorithm>

#include "firmware_host/outputs/page/base64.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

const char* kindName(PlotKind kind) {
  switch (kind) {
    case PlotKind::kPlan:
      return "plan";
    case PlotKind::kHistogram:
      return "histogram";
    case PlotKind::kDrawing:
      return "drawing";
    case PlotKind::kTime:
      break;
  }
  return "time";
}

const char* styleName(SeriesStyle style) {
  switch (style) {
    case SeriesStyle::kPoints:
      return "points";
    case SeriesStyle::kTruth:
      return "truth";
    case SeriesStyle::kBand:
      return "band";
    case SeriesStyle::kLine:
      break;
  }
  return "line";
}

std::string column(const std::vector<double>& values) {
  const std::vector<float> narrow(values.begin(), values.end());
  return base64Of(std::span<const float>(narrow));
}

}  // namespace

bool Plot::empty() const {
  return svg.empty() && std::ranges::all_of(series, [](const Series& one) { return one.x.empty(); });
}

Series decimated(const Series& series, std::size_t most) {
  const std::size_t count = series.x.size();
  if (count <= most || most < 4) return series;
  const std::vector<double>& judged = series.value.size() == count ? series.value : series.y;
  const std::size_t parts = (most - 2) / 2;
  Series kept;
  kept.name = series.name;
  kept.style = series.style;
  const auto keep = [&](std::size_t i) {
    kept.x.push_back(series.x[i]);
    kept.y.push_back(series.y[i]);
    if (series.value.size() == count) kept.value.push_back(series.value[i]);
  };
  keep(0);
  for (std::size_t part = 0; part < parts; ++part) {
    // Excluding the first and the last point.
    const std::size_t begin = 1 + part * (count - 2) / parts;
    const std::size_t end = 1 + (part + 1) * (count - 2) / parts;
    std::size_t low = begin;
    std::size_t high = begin;
    for (std::size_t i = begin; i < end; ++i) {
      if (judged[i] < judged[low]) low = i;
      if (judged[i] > judged[high]) high = i;
    }
    keep(std::min(low, high));
    if (low != high) keep(std::max(low, high));
  }
  keep(count - 1);
  return kept;
}

Json toJson(const Plot& plot) {
  Json json = {{"id", plot.id},           {"group", plot.group},
               {"title", plot.title},     {"kind", kindName(plot.kind)},
               {"x_label", plot.x_label}, {"y_label", plot.y_label}};
  if (!plot.value_label.empty()) json["value_label"] = plot.value_label;
  if (!plot.svg.empty()) json["svg"] = plot.svg;
  if (!plot.note.empty()) json["note"] = plot.note;
  if (!plot.markers.empty()) {
    json["markers"] = Json::array();
    for (const PlotMarker& marker : plot.markers) {
      json["markers"].push_back({{"x", marker.x}, {"text", marker.text}});
    }
  }
  json["series"] = Json::array();
  for (const Series& whole : plot.series) {
    const Series series = decimated(whole, kMostPoints);
    Json one = {{"name", series.name},
                {"style", styleName(series.style)},
                {"count", series.x.size()},
                {"x", column(series.x)},
                {"y", column(series.y)}};
    if (!series.value.empty()) one["value"] = column(series.value);
    json["series"].push_back(one);
  }
  return json;
}

}  // namespace swiftlet
