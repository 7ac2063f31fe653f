#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/board/same_moment.hpp"
#include "firmware_host/lab/calibrate/cameras/board_pose.hpp"
#include "firmware_host/lab/calibrate/cameras/lens_start.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kStartViews = 30;
constexpr std::size_t kMostViews = 200;  ///< sigmas fall with its square root; more cost time and page size
constexpr std::size_t kFewestPairs = 3;  ///< moments seen by both cameras that a transform needs
constexpr double kStrongEvidence = 10;   ///< difference of the information criterion
constexpr double kFarOff = 5;            ///< sigmas; a worse view shows something else

struct Choice {
  std::optional<LensStart> fit;
  std::string why;
};

std::vector<const Moment*> seenBy(const std::vector<Moment>& moments, std::size_t camera) {
  std::vector<const Moment*> seen;
  for (const Moment& moment : moments) {
    if (moment.seen[camera] != nullptr) seen.push_back(&moment);
  }
  return seen;
}

Choice chooseModel(const CameraInput& input, const std::vector<Moment>& moments, std::size_t camera) {
  std::array<CameraModel, kMaxCameras> size;
  size[camera] = {CameraKind::kEquidistant, input.image_size[camera].x(), input.image_size[camera].y(),
                  Eigen::Vector4d::Ones(), Eigen::Vector4d::Zero()};
  const std::vector<const Moment*> start = spreadMoments(seenBy(moments, camera), size, kStartViews);
  const auto fit = [&](CameraKind kind) {
    return fitLens(input.target, kind, camera, input.image_size[camera], start);
  };
  const std::optional<LensStart> pinhole = fit(CameraKind::kPinholeRadtan);
  const std::optional<LensStart> wide = fit(CameraKind::kEquidistant);
  Choice choice;
  if (!pinhole || !wide) {
    choice.fit = pinhole ? pinhole : wide;
    if (choice.fit) {
      choice.why = pinhole ? "radial-tangential: Kannala-Brandt does not fit"
                           : "Kannala-Brandt: radial-tangential does not fit";
    }
    return choice;
  }
  const double clip = std::min(pinhole->sigma, wide->sigma);
  const double pinhole_square = pinhole->meanSquare(input.target, camera, start, clip);
  const double wide_square = wide->meanSquare(input.target, camera, start, clip);
  double residuals = 0;
  for (const Moment* moment : start)
    residuals += 2.0 * static_cast<double>(moment->seen[camera]->corners.size());
  const double evidence = residuals * std::log(pinhole_square / wide_square);
  const bool takes_wide = evidence > kStrongEvidence;
  choice.fit = takes_wide ? wide : pinhole;
  const double other_rms = std::sqrt(takes_wide ? pinhole_square : wide_square);
  choice.why = fmt::format(
      "{}: rms {:.3f} px on {} views, {} {:.3f} px; information criterion {:+.0f} in favour of "
      "Kannala-Brandt, which is chosen above {:.0f}",
      takes_wide ? "Kannala-Brandt" : "radial-tangential",
      std::sqrt(takes_wide ? wide_square : pinhole_square), start.size(),
      takes_wide ? "radial-tangential" : "Kannala-Brandt", other_rms, evidence, kStrongEvidence);
  return choice;
}

/// Of the transforms from single moments, the one nearest to the others.
std::optional<SE3> firstTransform(const CameraInput& input, const std::vector<Moment>& moments,
                                  const std::array<CameraModel, kMaxCameras>& lens, double most_rms) {
  std::vector<const Moment*> both;
  for (const Moment& moment : moments) {
    if (moment.seen[0] != nullptr && moment.seen[1] != nullptr) both.push_back(&moment);
  }
  std::vector<SE3> transforms;
  for (const Moment* moment : spreadMoments(both, lens, kStartViews)) {
    const std::optional<SE3> first = boardPose(input.target, lens[0], *moment->seen[0], most_rms);
    const std::optional<SE3> second = boardPose(input.target, lens[1], *moment->seen[1], most_rms);
    if (first && second) transforms.push_back(*second * first->inverse());
  }
  if (transforms.size() < kFewestPairs) return std::nullopt;
  double least = std::numeric_limits<double>::infinity();
  SE3 best;
  for (const SE3& one : transforms) {
    double sum = 0;
    for (const SE3& other : transforms) {
      sum += logSo3(one.rotation.conjugate() * other.rotation).norm() +
             (one.translation - other.translation).norm();
    }
    if (sum >= least) continue;
    least = sum;
    best = one;
  }
  return best;
}

void fillResiduals(const CameraBundle& bundle, CameraSolution& solution) {
  std::array<double, kMaxCameras> squares{};
  std::array<double, kMaxCameras> used{};
  for (std::size_t v = 0; v < bundle.views.size(); ++v) {
    const BundleView& view = bundle.views[v];
    solution.views.push_back({view.stamp, view.T_cam0_board});
    for (const BundleCorner& corner : view.corners) {
      CornerResidual entry{corner.camera, v, corner.id, corner.pixel, Eigen::Vector2d::Zero(), !corner.used};
      if (!bundle.residual(view, corner, entry.residual)) entry.residual.setZero();
      if (corner.used) {
        squares[corner.camera] += entry.residual.squaredNorm();
        used[corner.camera] += 2;
      }
      solution.corners.push_back(entry);
    }
  }
  for (std::size_t c = 0; c < bundle.camera_count; ++c) {
    solution.camera[c].rms = std::sqrt(squares[c] / std::max(1.0, used[c]));
  }
}

Eigen::MatrixXd covarianceOf(const CameraBundle& bundle, double sigma) {
  const Eigen::MatrixXd A = bundle.information();
  const Eigen::VectorXd scale = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse = (scale.asDiagonal() * A * scale.asDiagonal()).inverse();
  const double noise = std::max(sigma, kLeastCornerSigma);
  return noise * noise * (scale.asDiagonal() * inverse * scale.asDiagonal());
}

/// Solves the lenses from every other view. False if there are too few views.
bool solveHalves(const CameraBundle& bundle, CameraSolution& solution, CameraEvidence& evidence) {
  for (std::size_t half = 0; half < 2; ++half) {
    CameraBundle part = bundle;
    part.views.clear();
    for (std::size_t i = half; i < bundle.views.size(); i += 2) part.views.push_back(bundle.views[i]);
    double sigma = 0;
    if (!part.solveWithoutOutliers(sigma)) return false;
    const Eigen::MatrixXd covariance = covarianceOf(part, sigma);
    for (std::size_t c = 0; c < bundle.camera_count; ++c) {
      solution.camera[c].halves[half] = part.lens[c];
      const auto at = static_cast<Eigen::Index>(8 * c);
      evidence.half_covariance[c] += covariance.block<8, 8>(at, at);
    }
  }
  return true;
}

}  // namespace

CameraSolution calibrateCameras(const CameraInput& input, const std::function<void(double)>& progress) {
  const auto say = [&](double part) {
    if (progress) progress(part);
  };
  CameraSolution solution;
  solution.camera_count = input.camera_count;
  const Moments moments = pairViews(input.views, input.camera_count);
  CameraEvidence evidence;
  evidence.input = &input;
  evidence.stamp_difference = moments.stamp_difference;
  for (auto& covariance : evidence.half_covariance) covariance.setZero();

  CameraBundle bundle;
  bundle.camera_count = input.camera_count;
  for (std::size_t c = 0; c < input.camera_count; ++c) {
    const Choice choice = chooseModel(input, moments.all, c);
    if (!choice.fit) {
      solution.reasons.push_back(
          fmt::format("Camera {}: no lens model fits its {} views of the board. Check the board file (kind, "
                      "columns, rows), and record the board from many sides, tilted and close",
                      c, seenBy(moments.all, c).size()));
      continue;
    }
    bundle.lens[c] = choice.fit->lens;
    evidence.alone_sigma[c] = choice.fit->sigma;
    solution.camera[c].why_this_model = choice.why;
    say(0.3 * static_cast<double>(c + 1) / static_cast<double>(input.camera_count));
  }
  if (!solution.reasons.empty()) return solution;
  const double worst = *std::max_element(evidence.alone_sigma.begin(), evidence.alone_sigma.end());
  if (input.camera_count == 2) {
    const std::optional<SE3> T = firstTransform(input, moments.all, bundle.lens, kFarOff * worst);
    if (!T) {
      solution.reasons.push_back(
          moments.stamp_difference > kSameMoment
              ? fmt::format("The cameras' images are {:.1f} ms apart, so no pair shows the board at one "
                            "time. Trigger the cameras together, or correct their stamps",
                            moments.stamp_difference * 1e3)
              : fmt::format("Fewer than {} image pairs show the board to both cameras. Hold it where their "
                            "images overlap",
                            kFewestPairs));
      return solution;
    }
    bundle.T_cam1_cam0 = *T;
  }

  chooseInformative(input.target, moments.all, kFarOff * worst, kMostViews, bundle);
  say(0.5);
  if (!bundle.solveWithoutOutliers(solution.corner_sigma)) {
    solution.reasons.emplace_back(
        "The views do not agree on one solution. Check that the board matches its file and is flat, and that "
        "the cameras are fixed to each other");
    return solution;
  }
  say(0.8);
  const Eigen::MatrixXd covariance = covarianceOf(bundle, solution.corner_sigma);
  for (std::size_t c = 0; c < input.camera_count; ++c) {
    const auto at = static_cast<Eigen::Index>(8 * c);
    solution.camera[c].model = bundle.lens[c];
    solution.camera[c].covariance = covariance.block<8, 8>(at, at);
    solution.camera[c].halves = {bundle.lens[c], bundle.lens[c]};
  }
  if (input.camera_count == 2) {
    solution.T_cam1_cam0 = bundle.T_cam1_cam0;
    solution.stereo_covariance = covariance.bottomRightCorner<6, 6>();
  }
  fillResiduals(bundle, solution);
  evidence.bundle = &bundle;
  if (!solveHalves(bundle, solution, evidence)) {
    solution.reasons.emplace_back(
        "Half of the views is too few for a second solution to compare with. Record the board from more "
        "sides");
  }
  addCameraReasons(evidence, solution);
  say(1);
  return solution;
}

}  // namespace swiftlet
