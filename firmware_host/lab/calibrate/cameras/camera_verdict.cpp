// Reasons not to trust a calibration of cameras.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kFewestGoodViews = 10;
constexpr double kImagePart = 0.95;  ///< of the image, for which a limit holds
/// rad: 0.3 px of a lens with 450 px focal length, a third of a tracked feature's error.
constexpr double kMostProjectionSigma = 0.7e-3;
constexpr double kMostCornerSigma = 1.5e-3;    ///< rad: 0.7 px of that lens; sharp images have a tenth
constexpr double kMostSigmaRatio = 2;          ///< of the two cameras' corner sigmas
constexpr double kMostJointRatio = 1.5;        ///< of the joint solution's sigma to the worse single one
constexpr double kMostOutliers = 0.05;         ///< of all corners
constexpr double kMostHalfRatio = 3;           ///< of the halves' difference to its 1 sigma
constexpr double kLeastHalfDifference = 2e-4;  ///< rad; smaller differences are harmless
constexpr double kMostBaselineError = 0.03;    ///< of the given baseline
constexpr double kLeastBaselineError = 2e-3;   ///< m, of a ruler
constexpr double kMostStampDifference = 5e-4;  ///< s
constexpr double kMostStretch = 0.004;         ///< of the board: 1 mm in 250
constexpr double kStretchSigmas = 5;
constexpr double kTriedStretch = 0.005;

/// How much a part of the board deviates from its file, and the sigma of that value.
struct Stretch {
  double value = 0;
  double sigma = std::numeric_limits<double>::infinity();
};

/// Minimum of the parabola through three solutions: with the board as given, slightly smaller, and slightly
/// larger.
template <typename Change>
Stretch stretchOf(const CameraBundle& bundle, double sigma, const Change& change) {
  std::array<double, 3> cost{};
  for (int i = 0; i < 3; ++i) {
    CameraBundle tried = bundle;
    for (BundleView& view : tried.views) {
      for (BundleCorner& corner : view.corners) change(corner, kTriedStretch * (i - 1));
    }
    if (!tried.solve(CameraBundle::Terms::kAll, 0)) return {};
    for (const BundleView& view : tried.views) {
      for (const BundleCorner& corner : view.corners) {
        Eigen::Vector2d r;
        if (corner.used && tried.residual(view, corner, r)) {
          cost[static_cast<std::size_t>(i)] += r.squaredNorm() / (sigma * sigma);
        }
      }
    }
  }
  const double curvature = (cost[0] - 2 * cost[1] + cost[2]) / (kTriedStretch * kTriedStretch);
  const double slope = (cost[2] - cost[0]) / (2 * kTriedStretch);
  // The cost is a sum of squares in sigmas, so its second derivative is twice the information.
  if (!(curvature > 0)) return {};
  return {-slope / curvature, std::sqrt(2 / curvature)};
}

bool isLarge(const Stretch& stretch) {
  return std::abs(stretch.value) > kMostStretch && std::abs(stretch.value) > kStretchSigmas * stretch.sigma;
}

struct Reasons {
  std::vector<std::string> all;
  std::vector<std::string> of_rolling;  ///< those that a rolling shutter explains too

  void push_back(std::string reason) { all.push_back(std::move(reason)); }
  void pushRolling(const std::string& reason) {
    all.push_back(reason);
    of_rolling.push_back(reason);
  }
};

void judgeBoard(const CameraSolution& solution, const CameraEvidence& evidence, Reasons& reasons) {
  const CalibrationTarget& target = evidence.input->target;
  const Stretch height = stretchOf(*evidence.bundle, solution.corner_sigma,
                                   [](BundleCorner& corner, double part) { corner.point.y() *= 1 + part; });
  if (isLarge(height)) {
    reasons.push_back(fmt::format(
        "The board's height is {:+.1f} % off relative to its width, compared with its file: measure the "
        "print in both directions and correct the file, or print it again without fitting to the page",
        height.value * 100));
  }
  if (!target.hasTags()) return;
  const Stretch gap =
      stretchOf(*evidence.bundle, solution.corner_sigma, [&target](BundleCorner& corner, double part) {
        const int tag = corner.id / 4;
        const double wider = target.size * target.gap * part;
        corner.point += Eigen::Vector3d(wider * (tag % target.columns), wider * (tag / target.columns), 0);
      });
  // A share of the gap is less than the same share of the board.
  if (std::abs(gap.value) * target.gap > kMostStretch && std::abs(gap.value) > kStretchSigmas * gap.sigma) {
    reasons.push_back(
        fmt::format("The gap between the tags is {:.3f} tag edges, but {:.3f} in the board file: measure "
                    "tags and gaps and correct tagSpacing",
                    target.gap * (1 + gap.value), target.gap));
  }
}

void judgeCamera(std::size_t c, const CameraSolution& solution, const CameraEvidence& evidence,
                 Reasons& reasons) {
  const SolvedCamera& camera = solution.camera[c];
  const double focal = camera.model.focal();
  std::vector<bool> seen(solution.views.size(), false);
  for (const CornerResidual& corner : solution.corners) {
    if (corner.camera == c && !corner.outlier) seen[corner.view] = true;
  }
  const auto views = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), true));
  if (views < kFewestGoodViews) {
    reasons.push_back(fmt::format(
        "Camera {}: {} usable views of the board, {} are required. Record longer, from more sides", c, views,
        kFewestGoodViews));
  }
  const double sigma = quantile(projectionSigmas(camera.model, camera.covariance), kImagePart);
  if (!std::isfinite(sigma)) {
    reasons.push_back(fmt::format(
        "Camera {}: the distortion folds inside the image, so {:.0f} % of it has no ray. Bring the "
        "board close and into every corner of the image",
        c, (1 - rayShare(camera.model)) * 100));
  } else if (!(sigma < kMostProjectionSigma * focal)) {
    reasons.push_back(
        fmt::format("Camera {}: a projected pixel is uncertain by up to {:.2f} px (1 sigma, in {:.0f} % of "
                    "the image), above {:.2f} px. Bring the board close and into every corner of the image, "
                    "and tilt it by 45 degrees to all sides",
                    c, sigma, kImagePart * 100, kMostProjectionSigma * focal));
  }
  if (camera.rms > kMostCornerSigma * focal) {
    reasons.pushRolling(fmt::format(
        "Camera {}: corner residuals are {:.2f} px, above {:.2f} px. Check that the image is sharp and that "
        "the board is flat and matches its file; hold a rolling shutter camera still for each image",
        c, camera.rms, kMostCornerSigma * focal));
  }
  const std::vector<ImagePoint> difference = projectionDifference(camera.halves[0], camera.halves[1]);
  const double expected = rms(projectionSigmas(camera.model, evidence.half_covariance[c]));
  if (rms(difference) > kMostHalfRatio * expected && rms(difference) > kLeastHalfDifference * focal) {
    reasons.pushRolling(fmt::format(
        "Camera {}: two halves of the views give lenses that differ by {:.2f} px rms, {:.1f} times what "
        "noise explains. The lens moved or refocused, the board is bent, or the shutter is rolling",
        c, rms(difference), rms(difference) / expected));
  }
}

void judgePair(const CameraSolution& solution, const CameraEvidence& evidence, Reasons& reasons) {
  const auto [low, high] = std::minmax(evidence.alone_sigma[0], evidence.alone_sigma[1]);
  if (high > kMostSigmaRatio * low) {
    const int blurred = evidence.alone_sigma[0] > evidence.alone_sigma[1] ? 0 : 1;
    reasons.push_back(
        fmt::format("Camera {}: its corners are {:.1f} times as noisy as the other camera's. Focus it, clean "
                    "its lens, or shorten its exposure",
                    blurred, high / low));
  }
  if (solution.corner_sigma > kMostJointRatio * high) {
    reasons.pushRolling(
        fmt::format("The two cameras fit the board to {:.2f} px separately but only to {:.2f} px together: "
                    "they are loose, or their images are not taken at the same time",
                    high, solution.corner_sigma));
  }
  if (evidence.stamp_difference > kMostStampDifference) {
    reasons.push_back(
        fmt::format("The stamps of the two cameras are {:.2f} ms apart. Trigger the cameras together",
                    evidence.stamp_difference * 1e3));
  }
  const double told = evidence.input->told_baseline;
  const double found = solution.T_cam1_cam0.translation.norm();
  if (told > 0 && std::abs(found - told) > std::max(kMostBaselineError * told, kLeastBaselineError)) {
    reasons.push_back(fmt::format(
        "The calibrated baseline is {:.1f} mm, but {:.1f} mm was measured: the board is {:.3f} times as "
        "large as its file says, or the measured baseline is not the one between the lenses",
        found * 1e3, told * 1e3, told / found));
  }
}

}  // namespace

void addCameraReasons(const CameraEvidence& evidence, CameraSolution& solution) {
  Reasons reasons;
  for (std::size_t c = 0; c < solution.camera_count; ++c) judgeCamera(c, solution, evidence, reasons);
  if (solution.camera_count == 2) judgePair(solution, evidence, reasons);
  const auto outliers = std::count_if(solution.corners.begin(), solution.corners.end(),
                                      [](const CornerResidual& corner) { return corner.outlier; });
  const double part =
      static_cast<double>(outliers) / static_cast<double>(std::max<std::size_t>(1, solution.corners.size()));
  if (part > kMostOutliers) {
    reasons.pushRolling(
        fmt::format("{:.1f} % of the corners were rejected as outliers, above {:.0f} %. Check for "
                    "reflections, a second board and motion blur",
                    part * 100, kMostOutliers * 100));
  }
  judgeBoard(solution, evidence, reasons);
  for (std::string& reason : reasons.all) solution.reasons.push_back(std::move(reason));
  solution.rolling_reasons = std::move(reasons.of_rolling);
}

}  // namespace swiftlet
