#include <fmt/format.h>

#include <cmath>

#include "firmware_host/lab/calibrate/page/image_drawing.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

constexpr std::array<const char*, 3> kColours = {"#1f6fb4", "#d1721a", "#2d8a42"};
constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

Plot deviationPlot(const ImuNoiseResult& result, std::size_t first) {
  std::vector<LogCurve> curves;
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    LogCurve seen{kAxes[i], kColours[i], true, {}, {}};
    LogCurve model{"", kColours[i], false, {}, {}};
    const AxisNoise& axis = result.axis[first + i];
    for (std::size_t k = 0; k < result.points.size(); ++k) {
      seen.x.push_back(result.points[k].tau);
      seen.y.push_back(std::sqrt(result.points[k].variance[static_cast<Eigen::Index>(first + i)]));
      if (k >= axis.model.size() || result.points[k].tau < axis.from_tau) continue;
      model.x.push_back(result.points[k].tau);
      model.y.push_back(axis.model[k]);
    }
    curves.push_back(std::move(seen));
    curves.push_back(std::move(model));
  }
  Plot plot;
  plot.id = first == 0 ? "gyro_allan" : "accel_allan";
  plot.group = "Allan deviation";
  plot.title = first == 0 ? "Gyro: Allan deviation (points) and fit (lines)"
                          : "Accelerometer: Allan deviation (points) and fit (lines)";
  plot.kind = PlotKind::kDrawing;
  plot.svg = logDrawing(curves, "averaging time [s]", first == 0 ? "rad/s" : "m/s^2");
  return plot;
}

}  // namespace

CalibrationPage imuNoisePage(const ImuNoiseResult& result) {
  CalibrationPage page;
  page.name = "Noise of the IMU of " + result.log;
  page.verdict = result.remarks.empty() ? PageVerdict::kGood : PageVerdict::kUsable;
  page.verdict_text = result.remarks.empty()
                          ? "Good: white noise and random walk are determined for every axis."
                          : "Usable, with limits:";
  for (const std::string& remark : result.remarks) page.words.push_back(remark + ".");
  for (const std::string& motion : result.motions)
    page.words.push_back("Moving parts of the log are excluded: " + motion + ".");
  page.plots = {deviationPlot(result, 0), deviationPlot(result, 3)};
  Table table{"noise",
              "Noise",
              {"axis", "white noise density", "1 sigma [%]", "random walk", "1 sigma [%]", "bias instability",
               "at [s]", "misfit [sigmas]", "unit"},
              {},
              false};
  for (std::size_t i = 0; i < result.axis.size(); ++i) {
    const AxisNoise& a = result.axis[i];
    table.rows.push_back(
        {fmt::format("{} {}", i < 3 ? "gyro" : "accel", kAxes[i % 3]), fmt::format("{:.4g}", a.density.value),
         fmt::format("{:.2f}", 100 * a.density.sigma / a.density.value),
         a.walk ? fmt::format("{:.4g}", a.walk->value) : fmt::format("below {:.2g}", a.walk_limit),
         a.walk ? fmt::format("{:.1f}", 100 * a.walk->sigma / a.walk->value) : "not measured",
         fmt::format("{}{:.3g}", a.instability_reached ? "" : "below ", a.instability),
         fmt::format("{:.3g}", a.instability_tau), fmt::format("{:.2f}", a.misfit),
         i < 3 ? "rad/s, per sqrt(Hz), s" : "m/s^2, per sqrt(Hz), s"});
  }
  page.tables.push_back(table);
  return page;
}

}  // namespace swiftlet
