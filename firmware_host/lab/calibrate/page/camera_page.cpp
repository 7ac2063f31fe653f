#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"
#include "firmware_host/lab/calibrate/page/board_evidence.hpp"
#include "firmware_host/lab/calibrate/page/page_rules.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

constexpr double kToDegrees = 180 / std::numbers::pi;
constexpr double kToMilli = 1e3;

// In flight, a point is seen with 0.45 px at 460 px of focal length, 1 mrad (smoother.pixel_sigma). A lens
// accurate to half of that adds hardly any error.
constexpr double kGoodAngle = 0.5e-3;  // rad
// The halves of the data differ by twice the sigma if there is only noise: mrcal's "most important
// diagnostic". Above twice that, the lens model does not fit or something moved.
constexpr double kHalvesTimes = 2;
constexpr double kLeastCoverage = 0.7;       // of the cells; elsewhere the lens is extrapolated
constexpr double kMostCornerSigma = 1.1e-3;  // rad: 0.5 px of a 460 px lens, the upper end of the usual range
constexpr double kMostBias = 0.3;            // of corner sigma
constexpr double kStereoAngle = 0.01 / kToDegrees;  // rad, for each 10 cm of baseline
constexpr double kStereoLength = 1e-3;              // of the baseline; see kBaselinePriorSigma
constexpr double kByChance = 3.5;                   // sigmas of a cell's mean, the largest of 200 cells

double percentile(std::vector<double> values, double part) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  if (values.empty()) return std::nan("");
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

/// Sets the sigmas of pixels without a ray to infinity, as projection_error.hpp does, but not a fisheye's.
std::vector<double> counted(const CameraModel& model, std::vector<double> sigmas) {
  if (model.kind() != CameraKind::kPinholeRadtan) return sigmas;
  for (double& sigma : sigmas) {
    if (std::isnan(sigma)) sigma = std::numeric_limits<double>::infinity();
  }
  return sigmas;
}

/// Largest mean residual of a cell, minus the effect of chance.
double cellBias(const BoardEvidence& evidence, std::size_t camera) {
  double most = 0;
  const std::vector<CellMean> cells = cellMeans(evidence, camera);
  for (const CellMean& cell : cells) {
    if (cell.count == 0) continue;
    const double chance = kByChance * evidence.corner_sigma / std::sqrt(static_cast<double>(cell.count));
    most = std::max(most, cell.mean.norm() - chance);
  }
  return most / evidence.corner_sigma;
}

/// Without a second solution, the halves have no lens.
bool hasHalves(const SolvedCamera& camera) {
  return camera.halves[0].width() > 0 && camera.halves[1].width() > 0;
}

Plot heatPlot(const std::string& id, const std::string& group, const std::string& title,
              const ImageDrawing& image) {
  Plot plot;
  plot.id = id;
  plot.group = group;
  plot.title = title;
  plot.kind = PlotKind::kDrawing;
  plot.svg = image.svg();
  return plot;
}

void addLens(const CameraSolution& solution, const BoardEvidence& evidence, std::size_t c, PageRules& rules,
             CalibrationPage& page) {
  const SolvedCamera& camera = solution.camera[c];
  const CameraModel& model = camera.model;
  const ImageGrid grid(model.width(), model.height());
  std::vector<Eigen::Vector2d> pixels;
  for (const ImageCell& cell : grid.cells()) pixels.push_back(cell.centre);
  const double focal = model.focal();
  const double good = kGoodAngle * focal;
  const std::string who = fmt::format("camera {}", c);

  const std::vector<double> sigmas = worstSigmas(model, camera.covariance, pixels);
  ImageDrawing uncertainty(model.width(), model.height());
  uncertainty.heat(grid, sigmas, 2 * good, "px, 1 sigma");
  const std::vector<double> all = counted(model, sigmas);
  const double rays = rayShare(model);
  uncertainty.caption(
      fmt::format("worst {:.3f} px, 95 % below {:.3f} px; best rotation taken out{}", percentile(all, 1),
                  percentile(all, 0.95),
                  rays < 1 ? fmt::format("; {:.0f} % of the image has no ray", 100 * (1 - rays)) : ""));
  page.plots.push_back(heatPlot(fmt::format("uncertainty{}", c), "Uncertainty and cross-validation",
                                who + ": uncertainty of a projected pixel", uncertainty));
  rules.atMost(who + ": uncertainty of a pixel, 95 % of the image", "px", percentile(all, 0.95), good,
               fmt::format("The lens of camera {} is not determined well enough in parts of the image. "
                           "Record more views there, close and tilted.",
                           c));

  const Coverage coverage = coverageOf(evidence, c);
  rules.atLeast(who + ": part of the image with corners", "", coverage.share, kLeastCoverage,
                fmt::format("Camera {} saw the board only in {:.0f} % of its image, least in the {} part. "
                            "Move the board there.",
                            c, 100 * coverage.share, coverage.emptiest));
  rules.atMost(who + ": largest mean residual of a cell, beyond chance", "corner sigma",
               cellBias(evidence, c), kMostBias,
               fmt::format("Residuals of camera {} have a systematic direction in parts of the image: its "
                           "lens model does not fit there. See the vectors.",
                           c));
  if (!hasHalves(camera)) return;
  const auto difference = projectionDifference(camera.halves[0], camera.halves[1], pixels, coverage.cells);
  const std::vector<double> rms_sigmas = rmsSigmas(model, camera.covariance, pixels);
  std::vector<double> sizes;
  double squares = 0;
  double expected = 0;
  std::vector<double> inside;
  for (std::size_t k = 0; k < difference.size(); ++k) {
    sizes.push_back(difference[k].norm());
    if (!coverage.cells[k] || !difference[k].allFinite() || !std::isfinite(rms_sigmas[k])) continue;
    inside.push_back(sizes.back());
    squares += 0.5 * difference[k].squaredNorm();  // per axis
    expected += 4 * rms_sigmas[k] * rms_sigmas[k];
  }
  ImageDrawing halves(model.width(), model.height());
  halves.heat(grid, sizes, 4 * good, "px");
  const double most = percentile(sizes, 0.95);
  for (std::size_t k = 0; k < difference.size(); ++k) {
    if (!difference[k].allFinite() || !(most > 0)) continue;
    const double length = std::min(1.5, sizes[k] / most);
    if (sizes[k] > 0) halves.arrow(pixels[k], grid.size() * length / sizes[k] * difference[k], "#20262b");
  }
  halves.caption(fmt::format("95 % below {:.3f} px in the covered part; arrows show the direction",
                             percentile(inside, 0.95)));
  page.plots.push_back(heatPlot(fmt::format("halves{}", c), "Uncertainty and cross-validation",
                                who + ": two halves of the data, difference after the best rotation",
                                halves));
  rules.atMost(
      who + ": difference of the halves, 95 % of the covered part", "px", percentile(inside, 0.95), 2 * good,
      fmt::format("Two halves of the data give different lenses for camera {}. Record more views.", c));
  rules.atMost(
      who + ": difference of the halves over twice the uncertainty", "", std::sqrt(squares / expected),
      kHalvesTimes,
      fmt::format("The halves of camera {} differ by more than noise explains: the board is bent, it moved "
                  "during the exposure, or the lens model does not fit.",
                  c));
}

void addValues(const CameraSolution& solution, CalibrationPage& page) {
  Table table{"values", "Values", {"what", "value", "1 sigma", "unit"}, {}, false};
  const auto row = [&](const std::string& what, double value, double sigma, const char* unit) {
    table.rows.push_back({what, fmt::format("{:.6g}", value), fmt::format("{:.2g}", sigma), unit});
  };
  for (std::size_t c = 0; c < solution.camera_count; ++c) {
    const SolvedCamera& camera = solution.camera[c];
    const bool radtan = camera.model.kind() == CameraKind::kPinholeRadtan;
    const std::array<const char*, 8> names = {
        "fx", "fy", "cx", "cy", "k1", "k2", radtan ? "p1" : "k3", radtan ? "p2" : "k4"};
    for (int i = 0; i < 8; ++i) {
      const double value = i < 4 ? camera.model.intrinsics()[i] : camera.model.distortion()[i - 4];
      row(fmt::format("camera {} {}", c, names.at(static_cast<std::size_t>(i))), value,
          std::sqrt(camera.covariance(i, i)), i < 4 ? "px" : "");
    }
  }
  if (solution.camera_count > 1) {
    const Eigen::Vector3d turn = kToDegrees * logSo3(solution.T_cam1_cam0.rotation);
    constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
    for (int i = 0; i < 3; ++i) {
      row(fmt::format("T_cam1_cam0 rotation {}", kAxes.at(static_cast<std::size_t>(i))), turn[i],
          kToDegrees * std::sqrt(solution.stereo_covariance(i, i)), "deg");
    }
    for (int i = 0; i < 3; ++i) {
      row(fmt::format("T_cam1_cam0 translation {}", kAxes.at(static_cast<std::size_t>(i))),
          kToMilli * solution.T_cam1_cam0.translation[i],
          kToMilli * std::sqrt(solution.stereo_covariance(3 + i, 3 + i)), "mm");
    }
  }
  page.tables.push_back(table);
}

}  // namespace

CalibrationPage cameraPage(const CameraSolution& solution, const CalibrationTarget& target,
                           const std::string& log) {
  CalibrationPage page;
  page.name = "Cameras of " + log;
  BoardEvidence evidence;
  evidence.camera_count = solution.camera_count;
  for (std::size_t c = 0; c < solution.camera_count; ++c) evidence.camera[c] = solution.camera[c].model;
  evidence.T_cam1_cam0 = solution.T_cam1_cam0;
  evidence.corner_sigma = solution.corner_sigma;
  evidence.target = target;
  evidence.views = solution.views;
  evidence.corners = solution.corners;

  PageRules rules;
  const bool found = solution.camera_count > 0 && solution.camera[0].model.width() > 0 &&
                     solution.camera[solution.camera_count - 1].model.width() > 0;
  if (!found) {
    rules.finish({"No lens was found."}, page);
    page.words.insert(page.words.end(), solution.reasons.begin(), solution.reasons.end());
    return page;
  }
  double focal = 0;
  for (std::size_t c = 0; c < solution.camera_count; ++c) {
    focal = std::max(focal, solution.camera[c].model.focal());
    page.words.push_back(fmt::format("Camera {}: {}", c, solution.camera[c].why_this_model));
  }
  rules.atMost("corner sigma", "px per axis", solution.corner_sigma, kMostCornerSigma * focal,
               "The corner noise is high. Use a shorter exposure, more light and a sharp print.");
  rules.atMost(
      "corners rejected", "", outlierShare(evidence), kMostOutliers,
      "Many corners were rejected. Check the outliers: reflections, blur, a bent board or a wrong target.");
  for (std::size_t c = 0; c < solution.camera_count; ++c) addLens(solution, evidence, c, rules, page);
  if (solution.camera_count > 1) {
    const double baseline = solution.T_cam1_cam0.translation.norm();
    constexpr double kPerBaseline = 0.1;  // m
    const double turn = std::sqrt(solution.stereo_covariance.diagonal().head<3>().maxCoeff());
    rules.atMost("camera to camera: rotation, 1 sigma", "deg", kToDegrees * turn,
                 kToDegrees * kStereoAngle * std::max(1.0, baseline / kPerBaseline),
                 "The rotation between the cameras is not determined well enough. Record views in which both "
                 "see the board.");
    const Eigen::Vector3d along = solution.T_cam1_cam0.translation.normalized();
    const double length = std::sqrt(along.dot(solution.stereo_covariance.bottomRightCorner<3, 3>() * along));
    rules.atMost("camera to camera: baseline, 1 sigma", "mm", kToMilli * length,
                 kToMilli * kStereoLength * baseline,
                 "The baseline is not determined well enough. Record close views in which both cameras see "
                 "the board.");
  }
  addValues(solution, page);
  rules.finish(solution.reasons, page);
  for (Plot& plot : boardPlots(evidence)) page.plots.push_back(std::move(plot));
  for (Table& table : boardTables(evidence)) page.tables.push_back(std::move(table));
  page.scene = boardScene(evidence);
  return page;
}

}  // namespace swiftlet
