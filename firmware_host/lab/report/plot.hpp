#pragma once
// One plot of the report as data, for the page and for the plain drawing.
//
// Numbers are doubles here and 32-bit floats in the document. x of kTime is seconds since the run's first
// image, rising; of kPlan metres, with the same scale as y; of kHistogram the left edges of columns on a
// logarithmic axis [ms]. kDrawing is shown unchanged.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace swiftlet {

enum class PlotKind { kTime, kPlan, kHistogram, kDrawing };
enum class SeriesStyle {
  kLine,
  kPoints,
  kTruth,  ///< a line in the colour used for truth
  kBand,   ///< from -y to y, behind the lines
};

struct Series {
  std::string name;
  SeriesStyle style = SeriesStyle::kLine;
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> value;  ///< for kPlan: value that colours the line; empty: none
};

/// A line across the plot at x, for example a budget.
struct PlotMarker {
  double x = 0;
  std::string text;
};

struct Plot {
  std::string id;
  std::string group;  ///< section of the report
  std::string title;
  PlotKind kind = PlotKind::kTime;
  std::string x_label;
  std::string y_label;
  std::string value_label;
  std::vector<Series> series;
  std::vector<PlotMarker> markers;
  std::string note;      ///< what is missing in the plot and why; empty: nothing
  std::string svg = {};  ///< for kDrawing, instead of series: an element with a viewBox

  [[nodiscard]] bool empty() const;  ///< no series with a point, and no drawing
};

/// Most points of a series in the document.
inline constexpr std::size_t kMostPoints = 4000;

/// The series reduced to at most `most` points: each of most / 2 equal parts keeps its lowest and its highest
/// value (of `value` if present, otherwise of y), in order; the first and the last point are kept. O(points).
Series decimated(const Series& series, std::size_t most);

/// {"id", "group", "title", "kind", "x_label", "y_label", "value_label", "note", "markers", "series":
/// [{"name", "style", "count", "x", "y", "value"}]}; columns as base64 of little-endian 32-bit floats,
/// decimated.
nlohmann::ordered_json toJson(const Plot& plot);

}  // namespace swiftlet
