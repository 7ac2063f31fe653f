#include "firmware_host/lab/calibrate/imu_camera/calibrate_imu_camera.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/core/median.hpp"
#include "firmware_host/lab/calibrate/imu_camera/batch_start.hpp"
#include "firmware_host/lab/calibrate/imu_camera/batch_verdict.hpp"

namespace swiftlet {
namespace {

constexpr double kFirstSpacing = 0.1;   // s
constexpr double kReadingsPerKnot = 4;  // at least
constexpr double kOutlierSigmas = 4;
constexpr double kRefineSigmas = 5;   // of chi^2 above what the same number of unknowns gains from noise
constexpr double kRollingSigmas = 4;  // of the readout, above zero
// s: rows of a rolling shutter are read out in some milliseconds. Less is a misfit of another cause that the
// readout absorbs; at 3 rad/s it moves the first and last row by 0.3 mrad, less than a track's error in
// flight.
constexpr double kLeastReadout = 2e-4;
constexpr double kFirstCornerSigma = 0.3;  // px, until estimated from the residuals
constexpr int kFirstSteps = 15;
constexpr int kSteps = 12;
constexpr double kRoughly = 1;  // squared sigmas that a further step would gain
constexpr double kSettled = 1e-4;

/// Marks corners beyond four sigma, by the median of the residuals, and those that the lens cannot project.
/// Returns the number of outliers.
std::size_t markOutliers(const BatchProblem& problem, BatchData& data, double& sigma) {
  std::vector<double> sizes;
  for (const SeenView& view : data.views) {
    for (const SeenCorner& corner : view.corners) {
      Eigen::Vector2d r;
      if (!problem.residual(view, corner, r)) continue;
      sizes.push_back(std::abs(r.x()));
      sizes.push_back(std::abs(r.y()));
    }
  }
  if (sizes.empty()) return 0;
  constexpr double kMedianOfNormal = 0.6745;
  sigma = medianOf(sizes) / kMedianOfNormal;
  std::size_t outliers = 0;
  for (SeenView& view : data.views) {
    for (SeenCorner& corner : view.corners) {
      Eigen::Vector2d r;
      const bool has_pixel = problem.residual(view, corner, r);
      if (!has_pixel && !problem.covers(problem.seconds(view, corner))) continue;
      corner.outlier = !has_pixel || r.cwiseAbs().maxCoeff() > kOutlierSigmas * sigma;
      outliers += corner.outlier ? 1 : 0;
    }
  }
  return outliers;
}

/// Sets the weights from the residuals.
void weigh(BatchProblem& problem) {
  const std::array<double, kResidualKinds> left = problem.redundancies();
  const auto factor = [&](Residuals which) {
    return std::sqrt(problem.cost(which) / std::max(left[static_cast<std::size_t>(which)], 1.0));
  };
  BatchNoise noise = problem.noise();
  noise.corner = std::max(noise.corner * factor(Residuals::kCorner), kLeastCornerSigma);
  noise.gyro *= factor(Residuals::kGyro);
  noise.accel *= factor(Residuals::kAccel);
  problem.setNoise(noise);
}

/// Sum of squares with each kind weighted by `noise`.
double costIn(const BatchProblem& problem, const BatchNoise& noise) {
  const BatchNoise& own = problem.noise();
  const auto square = [](double x) { return x * x; };
  return problem.cost(Residuals::kCorner) * square(own.corner / noise.corner) +
         problem.cost(Residuals::kGyro) * square(own.gyro / noise.gyro) +
         problem.cost(Residuals::kAccel) * square(own.accel / noise.accel);
}

/// Halves the spacing of the knots until a halving explains no more than noise. The last one is kept: it only
/// costs time.
void chooseKnots(BatchProblem& problem, double rate_hz) {
  while (problem.state().spline.spacing() / 2 >= kReadingsPerKnot / rate_hz) {
    const BatchProblem coarse = problem;
    problem.refineSpline();
    problem.solve(kSteps, false, kRoughly);
    weigh(problem);
    // Both weighted by the noise estimated with the finer spline.
    const double gain = costIn(coarse, problem.noise()) - costIn(problem, problem.noise());
    const double more = problem.chainSize() - coarse.chainSize();
    if (gain < more + kRefineSigmas * std::sqrt(2 * more)) return;
  }
}

BatchState halfOf(const BatchState& whole, bool second) {
  BatchState half = whole;
  const std::vector<SE3>& controls = whole.spline.controls();
  const std::size_t segments = controls.size() + 1 - SplineTrajectory::kOrder;
  const auto every = static_cast<std::size_t>(whole.bias_every);
  const std::size_t cut = segments / 2 / every * every;
  const std::size_t from = second ? cut : 0;
  const std::size_t to = second ? segments : cut;
  half.spline = SplineTrajectory(
      whole.spline.startTime() + static_cast<double>(from) * whole.spline.spacing(), whole.spline.spacing(),
      {controls.begin() + static_cast<std::ptrdiff_t>(from),
       controls.begin() + static_cast<std::ptrdiff_t>(to + SplineTrajectory::kOrder - 1)});
  const auto first_bias = static_cast<std::ptrdiff_t>(from / every);
  half.bias.assign(
      whole.bias.begin() + first_bias,
      std::min(whole.bias.end(), whole.bias.begin() + static_cast<std::ptrdiff_t>(to / every) + 2));
  return half;
}

}  // namespace

ImuCameraSolution calibrateImuCamera(const ImuCameraInput& input,
                                     const std::function<void(double)>& progress) {
  const auto tell = [&](double share) {
    if (progress) progress(share);
  };
  BatchStart start =
      startBatch(input.target, input.views, input.samples, input.noise, input.cameras, kFirstSpacing);
  if (!start.reasons.empty()) {
    ImuCameraSolution failed;
    failed.reasons = start.reasons;
    return failed;
  }
  tell(0.05);
  BatchProblem problem(start.data, start.state, {kFirstCornerSigma, 1, 1});

  // Coarse motion first, with the parameters fixed that influence it least.
  for (std::size_t c = 0; c < start.state.camera_count; ++c) problem.hold(batch::lens(c), kLensParameters);
  problem.hold(batch::kReadout, 1);
  problem.hold(batch::kGyro, 9 + 6);
  problem.solve(kFirstSteps, true, kRoughly);
  tell(0.15);
  for (std::size_t c = 0; c < start.state.camera_count; ++c)
    problem.hold(batch::lens(c), kLensParameters, false);
  problem.hold(batch::kReadout, 1, false);
  problem.hold(batch::kGyro, 9 + 6, false);
  problem.solve(kFirstSteps, true, kRoughly);
  tell(0.3);
  BatchNoise noise = problem.noise();
  markOutliers(problem, start.data, noise.corner);
  problem.setNoise(noise);
  problem.solve(kSteps, false, kRoughly);
  BatchVerdict verdict(input, start);
  chooseKnots(problem, input.noise.rate_hz);
  tell(0.6);

  const double readout_sigma = std::sqrt(problem.covariance()(batch::kReadout, batch::kReadout));
  verdict.rolling =
      std::abs(problem.state().readout) > std::max(kRollingSigmas * readout_sigma, kLeastReadout);
  if (!verdict.rolling) {
    problem.setReadout(0);
    problem.hold(batch::kReadout, 1);
  }
  noise = problem.noise();
  verdict.outliers = markOutliers(problem, start.data, noise.corner);
  problem.solve(kSteps, false, kRoughly);
  weigh(problem);
  verdict.settled = problem.solve(kSteps, false, kSettled);
  tell(0.75);
  ImuCameraSolution solution = verdict.solutionOf(problem);
  tell(0.8);

  for (const bool second : {false, true}) {
    BatchProblem half(start.data, halfOf(problem.state(), second), problem.noise());
    if (!verdict.rolling) half.hold(batch::kReadout, 1);
    half.solve(kSteps, false, kSettled);
    verdict.halves[second ? 1 : 0] = half.state();
    verdict.half_covariances[second ? 1 : 0] = half.covariance();
    tell(second ? 1.0 : 0.9);
  }
  verdict.judge(problem, solution);
  return solution;
}

}  // namespace swiftlet
