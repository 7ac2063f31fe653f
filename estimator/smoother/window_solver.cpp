#include "estimator/smoother/window_solver.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"
#include "estimator/smoother/pixel_noise.hpp"

namespace swiftlet {
namespace {

// The first-order bias correction of an increment has an error of about (bias change x duration)^2 / 2.
constexpr double kReintegrateGyro = 5e-4;   // rad/s
constexpr double kReintegrateAccel = 5e-2;  // m/s^2
constexpr double kRelativeDamping = 1e-10;
constexpr int kTriangulationStart = 6;         // iterations for a landmark in its first solve
constexpr int kTriangulationRestart = 2;       // iterations for all landmarks after a step was undone
constexpr double kConverged = 1e-4;            // m, rad, m/s: smallest step worth another iteration
constexpr double kCostIncreaseAllowed = 0.02;  // relative to the factors' cost; a larger one undoes the step
constexpr double kOutlierSigmas = 20.0;        // for single observations, during the solve
constexpr double kFinalOutlierSigmas = 3.5;
constexpr int kMaxRejections = 3;  // number of solves in which a landmark does not fit before it is removed

// Length of the longest 3-vector in a step, and of the image times, which come first. Lengths instead of
// components, so that convergence does not depend on the directions of the world's axes. The `extra` columns
// after the first `calibration` are skipped: distant points are not worth an iteration.
double largestStep(const VectorMap& step, int times, int calibration, int extra) {
  double largest = 0;
  for (Eigen::Index k = 0; k < times; ++k) largest = std::max(largest, std::abs(step[k]));
  for (Eigen::Index k = times; k + 3 <= step.size(); k += 3) {
    if (k >= calibration && k < calibration + extra) continue;
    largest = std::max(largest, step.segment<3>(k).norm());
  }
  return largest;
}

// Length of the longest 3-vector among the poses' parts.
double largestPoseStep(const VectorMap& step, const Window& window) {
  double largest = 0;
  for (std::size_t k = 0; k < window.size(); ++k) {
    const Eigen::Index at = window[k].offset;
    largest = std::max({largest, step.segment<3>(at).norm(), step.segment<3>(at + 3).norm()});
  }
  return largest;
}

// The prior's cost has an arbitrary constant, so only differences of the sum are meaningful.
bool rises(const WindowCost& before, const WindowCost& after) {
  const double change = after.factors + after.prior - (before.factors + before.prior);
  return change > kCostIncreaseAllowed * after.factors;
}

// Counts a failed fit. True if the landmark has failed too often.
bool reject(WindowProblem& problem, Landmark& landmark) {
  if (++landmark.rejections < kMaxRejections) return false;
  landmark.in_system = false;
  problem.extras.discard(landmark);
  return true;
}

}  // namespace

WindowSolver::WindowSolver() : eliminated_(kMaxLandmarks), step_(kMaxSystemDim) {
  squares_.reserve(kMaxCameras * kMaxLandmarks);
}

void WindowSolver::reintegrate(WindowProblem& problem) const {
  Window& window = problem.window;
  for (std::size_t k = 1; k < window.size(); ++k) {
    WindowState& state = window[k];
    const WindowState& previous = window[k - 1];
    if (!previous.has_motion || state.link != LinkKind::kImu) continue;
    const Eigen::Vector3d gyro = state.imu.biasFor(problem.intrinsics.now(), previous.x.bias_gyro);
    const bool moved = (gyro - state.imu.biasGyro()).norm() > kReintegrateGyro ||
                       (previous.x.bias_accel - state.imu.biasAccel()).norm() > kReintegrateAccel;
    // When the last interval but one was integrated, the sample after its last image was not available yet.
    if (moved || k + 2 == window.size()) problem.integrateLink(state, previous);
  }
}

// Triangulates landmarks without a point. Others move by `iterations` steps of their own; with 0 they stay
// where the last step put them. A point behind a camera that observed it is found when observations are
// checked.
void WindowSolver::triangulateAll(WindowProblem& problem, int iterations) const {
  for (Landmark& landmark : problem.landmarks) {
    if (landmark.extra != kNoExtra) {
      landmark.in_system = !landmark.sightings.empty();
      continue;
    }
    landmark.in_system = landmark.sightings.size() >= 2;
    const int steps = landmark.point.triangulated ? iterations : kTriangulationStart;
    if (landmark.in_system && steps > 0) {
      landmark.in_system = triangulate(problem.rig_poses, landmark.views(), steps, landmark.point);
    }
  }
}

void WindowSolver::build(WindowProblem& problem, NormalEquations& system, bool first) {
  system.begin(problem.calibration.layout(), problem.dimension);
  cost_.prior = addPrior(problem, system, step_);
  for (std::size_t k = 1; k < problem.window.size(); ++k) addMotion(problem, k, system);
  for (Landmark& landmark : problem.landmarks) {
    if (!landmark.in_system || landmark.extra != kNoExtra) continue;
    EliminatedPoint& eliminated = eliminated_[problem.landmarks.indexOf(landmark)];
    landmark.in_system = system.addLandmark(problem.viewsOf(landmark.views()), landmark.point,
                                            problem.window.slots(), &eliminated);
    if (landmark.in_system && first) landmark.point.inverse_depth_sigma = eliminated.inverseDepthSigma();
  }
  addExtras(problem, system);
  system.finish(problem.window.slots());
  finishExtras(problem, system);
  cost_.factors = system.cost();
}

// Applies the landmarks' part of the step by back-substitution.
void WindowSolver::substitutePoints(WindowProblem& problem, const VectorMap& step) const {
  const StepOfStates states(step, problem.window.slots(), problem.calibration.dimension());
  for (Landmark& landmark : problem.landmarks) {
    if (!landmark.in_system || landmark.extra != kNoExtra) continue;
    LandmarkPoint& point = landmark.point;
    const Eigen::Vector3d point_step = eliminated_[problem.landmarks.indexOf(landmark)].step(states);
    landmark.in_system = point_step.allFinite();
    if (landmark.in_system) movePoint(point_step, PointBasis::of(point.bearing), point);
  }
}

void WindowSolver::takeBack(WindowProblem& problem) const {
  problem.restore();
  problem.placeCameras();
  triangulateAll(problem, kTriangulationRestart);
}

// Call before any observation is rejected. A point fitted to n views absorbs three of their 2 n components.
double WindowSolver::medianOfNewest(const WindowProblem& problem) {
  squares_.clear();
  const std::uint8_t newest = problem.window.newestSlot();
  for (const Landmark& landmark : problem.landmarks) {
    if (!landmark.in_system || landmark.sightings.empty()) continue;
    const Sighting& sighting = landmark.sightings.back();
    if (sighting.slot != newest) continue;
    const double components = 2.0 * landmark.viewCount();
    if (landmark.sightings.size() < 2 || components <= 3) continue;
    const double share = (components - 3) / components;
    for (std::size_t c = 0; c < problem.rig.camera_count; ++c) {
      const CameraSighting& view = sighting.camera[c];
      Eigen::Vector2d r;
      if (view.used && reprojectionResidual(view, problem.rig_poses[newest].current[c], landmark.point, r)) {
        squares_.push_back(r.squaredNorm() / share);
      }
    }
  }
  if (squares_.size() < PixelNoise::kFewestSightings) return 0;
  return medianOf(squares_);
}

Status WindowSolver::solve(WindowProblem& problem, NormalEquations& system, WindowCovariance& covariance,
                           int iterations, double pose_tolerance, FrameStatistics& statistics) {
  problem.assignOffsets();
  problem.extras.settlePlanes();
  reintegrate(problem);
  const int calibration = problem.calibration.dimension();
  const int times = problem.calibration.layout().times();
  bool unchecked = false;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    problem.placeCameras();
    if (iteration == 0) triangulateAll(problem, 0);
    if (iteration == 1) {
      median_square_ = medianOfNewest(problem);
      rejectNewestSightings(problem, kOutlierSigmas);
    }
    const WindowCost before = cost_;
    build(problem, system, iteration == 0);
    // Not after the first step, because observations were rejected since.
    if (iteration > 1 && rises(before, cost_)) {
      takeBack(problem);
      unchecked = false;
      break;
    }
    MatrixMap H = system.H();
    for (int k = 0; k < problem.dimension; ++k) H(k, k) *= 1.0 + kRelativeDamping;
    for (int k = 0; k < problem.intrinsics.dimension(); ++k) {
      const int column = problem.intrinsics.offset() + k;
      H(column, column) += problem.intrinsics.heldInformation();
    }
    if (!choleskyInPlace(H)) {
      if (iteration == 0) return {StatusCode::kFailed, "the window's normal equations are singular; reset"};
      break;
    }
    covariance.take(system, problem);
    VectorMap step(step_.data(), problem.dimension);
    step = -system.g();
    choleskySolve(covariance.factor(), step);
    if (!step.allFinite()) return {StatusCode::kFailed, "the window's solution is not finite; reset"};
    problem.backup();
    substitutePoints(problem, step);
    problem.retract(step);
    statistics.iterations = iteration + 1;
    unchecked = largestStep(step, times, calibration,
                            problem.intrinsics.dimension() + problem.extras.columns()) >= kConverged &&
                largestPoseStep(step, problem.window) >= pose_tolerance;
    if (!unchecked) break;
  }
  problem.placeCameras();
  if (unchecked && rises(cost_, costOf(problem, step_))) takeBack(problem);
  if (statistics.iterations < 2) median_square_ = medianOfNewest(problem);
  rejectNewestSightings(problem, kFinalOutlierSigmas);
  rejectLandmarks(problem, kFinalOutlierSigmas);
  return okStatus();
}

void rejectNewestSightings(WindowProblem& problem, double sigmas) {
  const std::uint8_t newest = problem.window.newestSlot();
  for (Landmark& landmark : problem.landmarks) {
    if (!landmark.in_system || landmark.sightings.empty()) continue;
    Sighting& sighting = landmark.sightings.back();
    if (sighting.slot != newest) continue;
    for (std::size_t c = 0; c < problem.rig.camera_count; ++c) {
      CameraSighting& view = sighting.camera[c];
      if (!view.used) continue;
      Eigen::Vector2d r;
      view.used = reprojectionResidual(view, problem.rig_poses[newest].current[c], landmark.point, r) &&
                  r.squaredNorm() <= sigmas * sigmas;
    }
    if (sighting.any()) continue;
    landmark.sightings.popBack();
    reject(problem, landmark);
  }
}

void rejectLandmarks(WindowProblem& problem, double sigmas) {
  for (Landmark& landmark : problem.landmarks) {
    landmark.mean_square = meanSquaredResidual(problem.rig_poses, landmark.views(), landmark.point);
    if (landmark.sightings.size() < 2) continue;
    if (landmark.in_system && landmark.mean_square <= sigmas * sigmas) continue;
    if (!reject(problem, landmark) && landmark.extra == kNoExtra) landmark.point.triangulated = false;
  }
}

}  // namespace swiftlet
