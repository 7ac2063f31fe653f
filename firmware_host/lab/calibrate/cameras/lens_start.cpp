#include "firmware_host/lab/calibrate/cameras/lens_start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "firmware_host/lab/calibrate/cameras/board_pose.hpp"

namespace swiftlet {
namespace {

constexpr double kNarrowest = 25 * std::numbers::pi / 180;  ///< horizontal field of view
constexpr double kWidestPinhole = 130 * std::numbers::pi / 180;
constexpr double kWidest = 230 * std::numbers::pi / 180;
constexpr double kWidening = 1.12;          ///< from one guess to the next: focal lengths within 6 percent
constexpr std::size_t kViewsForFocal = 12;  ///< used for the first guesses
constexpr std::size_t kFewestViews = 3;     ///< Zhang: two determine the lens, a third reveals a mistake
constexpr double kNoPose = 1e3;             ///< px, for a view without a pose
constexpr double kClipSigmas = 4;

/// Views of a single camera are entered as camera 0's.
void addView(const CalibrationTarget& target, const BoardView& view, const SE3& T_cam_board,
             CameraBundle& bundle) {
  BundleView added;
  added.stamp = view.stamp;
  added.T_cam0_board = T_cam_board;
  added.add(target, 0, view);
  bundle.views.push_back(std::move(added));
}

/// Mean residual length of a view at its best pose for this lens; residuals are limited to `clip`.
double misfit(const CalibrationTarget& target, const CameraModel& lens, const BoardView& view, double clip) {
  const std::optional<SE3> T = boardPose(target, lens, view, kNoPose);
  if (!T) return clip;
  double sum = 0;
  for (const BoardCorner& corner : view.corners) {
    Eigen::Vector2d pixel;
    const bool seen = lens.project(*T * target.corner(corner.id), pixel);
    sum += seen ? std::min(clip, (corner.pixel - pixel).norm()) : clip;
  }
  return sum / static_cast<double>(view.corners.size());
}

CameraModel firstLens(const CalibrationTarget& target, CameraKind kind, std::size_t camera,
                      const Eigen::Vector2i& size, const std::vector<const Moment*>& moments) {
  const bool pinhole = kind == CameraKind::kPinholeRadtan;
  CameraModel best;
  double least = std::numeric_limits<double>::infinity();
  for (double view = kNarrowest; view < (pinhole ? kWidestPinhole : kWidest); view *= kWidening) {
    const double focal = pinhole ? 0.5 * size.x() / std::tan(0.5 * view) : size.x() / view;
    const CameraModel lens(kind, size.x(), size.y(),
                           {focal, focal, 0.5 * (size.x() - 1), 0.5 * (size.y() - 1)},
                           Eigen::Vector4d::Zero());
    double sum = 0;
    for (std::size_t i = 0; i < std::min(kViewsForFocal, moments.size()); ++i) {
      sum += misfit(target, lens, *moments[i]->seen[camera], 0.05 * size.x());
    }
    if (sum >= least) continue;
    least = sum;
    best = lens;
  }
  return best;
}

}  // namespace

double LensStart::meanSquare(const CalibrationTarget& target, std::size_t camera,
                             const std::vector<const Moment*>& moments, double clip_sigma) const {
  const double clip = kClipSigmas * clip_sigma;
  double sum = 0;
  double corners = 0;
  for (const Moment* moment : moments) {
    const BoardView& view = *moment->seen[camera];
    const std::optional<SE3> T = boardPose(target, lens, view, kNoPose);
    for (const BoardCorner& corner : view.corners) {
      Eigen::Vector2d pixel;
      const bool seen = T && lens.project(*T * target.corner(corner.id), pixel);
      sum += seen ? std::min(clip * clip, (corner.pixel - pixel).squaredNorm()) : clip * clip;
    }
    corners += static_cast<double>(view.corners.size());
  }
  return sum / std::max(1.0, 2 * corners);
}

std::optional<LensStart> fitLens(const CalibrationTarget& target, CameraKind kind, std::size_t camera,
                                 const Eigen::Vector2i& size, const std::vector<const Moment*>& moments) {
  if (moments.size() < kFewestViews) return std::nullopt;
  CameraBundle bundle;
  bundle.lens[0] = firstLens(target, kind, camera, size, moments);
  if (bundle.lens[0].width() == 0) return std::nullopt;
  // The second pass uses the lens found: views without a pose, or with a poor one, get a new pose.
  for (const double most_rms : {kNoPose, kNoPose}) {
    bundle.views.clear();
    for (const Moment* moment : moments) {
      const BoardView& view = *moment->seen[camera];
      const std::optional<SE3> T = boardPose(target, bundle.lens[0], view, most_rms);
      if (T) addView(target, view, *T, bundle);
    }
    if (bundle.views.size() < kFewestViews) return std::nullopt;
    const double scale = 3 * std::max(1e-3, bundle.medianResidual());
    if (!std::isfinite(scale) || !bundle.solve(CameraBundle::Terms::kOne, scale)) return std::nullopt;
  }
  LensStart fit;
  if (!bundle.solveWithoutOutliers(fit.sigma) || bundle.views.size() < kFewestViews) return std::nullopt;
  fit.lens = bundle.lens[0];
  if (!(fit.lens.intrinsics().head<2>().minCoeff() > 0)) return std::nullopt;
  return fit;
}

}  // namespace swiftlet
