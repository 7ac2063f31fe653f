#include "estimator/smoother/window_factors.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/rest_detector.hpp"
#include "estimator/smoother/point_system.hpp"

namespace swiftlet {
namespace {

constexpr double kRestPositionSigma = 3e-4;    // m, between two frames at rest: 6 mm/s at 20 Hz
constexpr double kRestRotationSigma = 3.5e-4;  // rad, between two frames at rest
constexpr double kResidualTime = 5.0;  // s, newest part of the window used to measure the IMU's errors
constexpr double kSumTime = 1.0;       // s, longer than the rate stays constant in most turns

// False if nothing links the state to the previous one.
bool motionFactor(const WindowProblem& problem, std::size_t position, MotionFactor& factor) {
  const WindowState& i = problem.window[position - 1];
  const WindowState& j = problem.window[position];
  if (!i.has_motion || !j.has_motion || j.link == LinkKind::kNone) return false;
  return j.link == LinkKind::kImu ? imuFactor(j.imu, problem.noise, i.x, j.x, factor, &problem.intrinsics)
                                  : constantVelocityFactor(j.link_duration, problem.noise, i.x, j.x, factor);
}

// Residuals of one sensor, added from newest to oldest. Correlated errors show in sums over a second.
class SensorResiduals {
 public:
  void add(const Eigen::Vector3d& residual, double seconds) {
    squares_ += residual.squaredNorm();
    ++count_;
    sum_ += residual;
    seconds_ += seconds;
    ++in_sum_;
    if (seconds_ < kSumTime) return;
    sum_squares_ += sum_.squaredNorm() / in_sum_;
    ++sums_;
    sum_.setZero();
    seconds_ = 0;
    in_sum_ = 0;
  }
  /// Mean square of a coordinate, of single residuals or of sums, whichever is larger; 0 before the first
  /// sum.
  [[nodiscard]] double meanSquare() const {
    return sums_ > 0 ? std::max(squares_ / count_, sum_squares_ / sums_) / 3 : 0;
  }

 private:
  double squares_ = 0;
  double sum_squares_ = 0;
  double seconds_ = 0;
  int count_ = 0;
  int in_sum_ = 0;
  int sums_ = 0;
  Eigen::Vector3d sum_ = Eigen::Vector3d::Zero();
};

// Rest is a soft constraint: the velocity is near zero, and two frames at rest have nearly the same pose. The
// factor is added and removed together with the motion factor between the two states, so that the prior
// inherits it.
Eigen::Matrix<double, kPoseDim, 1> restResidual(const WindowState& i, const WindowState& j) {
  Eigen::Matrix<double, kPoseDim, 1> residual;
  residual.head<3>() =
      logSo3(i.x.T_world_body.rotation.conjugate() * j.x.T_world_body.rotation) / kRestRotationSigma;
  residual.tail<3>() = (j.x.T_world_body.translation - i.x.T_world_body.translation) / kRestPositionSigma;
  return residual;
}

void addRest(const WindowState& i, const WindowState& j, NormalEquations& system) {
  if (j.rest == 0) return;
  system.addDiagonal(j, 6, j.x.v_world_body, kRestVelocitySigma);
  if (i.rest != j.rest) return;  // moved in between, although no frame of that motion may be left
  MotionFactor factor;
  factor.residual.setZero();
  factor.jacobian_i.setZero();
  factor.jacobian_j.setZero();
  factor.residual.head<kPoseDim>() = restResidual(i, j);
  factor.jacobian_i.block<3, 3>(0, 0) = -Eigen::Matrix3d::Identity() / kRestRotationSigma;
  factor.jacobian_j.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() / kRestRotationSigma;
  factor.jacobian_i.block<3, 3>(3, 3) = -Eigen::Matrix3d::Identity() / kRestPositionSigma;
  factor.jacobian_j.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() / kRestPositionSigma;
  system.addMotion(factor, i, j);
}

// Deviation from the reference for the states in the prior. `work` provides the memory.
VectorMap priorDeviation(WindowProblem& problem, std::vector<double>& work) {
  const Prior& prior = problem.prior;
  VectorMap deviation(work.data(), prior.dimension());
  for (const PriorBlock& block : prior.blocks()) {
    if (block.slot == PriorBlock::kCalibration) {
      deviation.segment(block.offset, block.dimension) =
          problem.calibration.deviation().head(block.dimension);
    } else if (block.slot == PriorBlock::kGyroIntrinsics) {
      deviation.segment<kGyroMatrixDim>(block.offset) = problem.intrinsics.deviation();
    } else if (block.isExtra()) {
      deviation.segment<kExtraDim>(block.offset) =
          problem.extras.states()[block.slot - kMaxStates].deviation();
    } else {
      deviation.segment(block.offset, block.dimension) =
          problem.window.inSlot(block.slot).x.minus(block.reference).head(block.dimension);
    }
  }
  return deviation;
}

void addSightings(const WindowProblem& problem, const ExtraState& extra, std::span<const Sighting> sightings,
                  NormalEquations& system) {
  system.addExplicitLandmark(problem.viewsOf(sightings), extra.x.point, extra.offset, problem.window.slots());
}

void addFactor(const WindowProblem& problem, const ExtraFactor& factor, NormalEquations& system) {
  LinearFactor linear;
  problem.extras.linearize(factor, linear);
  system.addFactor(linear);
}

}  // namespace

double addPrior(WindowProblem& problem, NormalEquations& system, std::vector<double>& work) {
  Prior& prior = problem.prior;
  if (prior.empty()) return 0;
  double cost = 0;
  MatrixMap H = system.H();
  VectorMap g = system.g();
  MatrixMap prior_H = prior.H();
  const VectorMap deviation = priorDeviation(problem, work);
  for (const PriorBlock& row : prior.blocks()) {
    const int at = problem.offsetOf(row.slot);
    for (const PriorBlock& column : prior.blocks()) {
      const int to = problem.offsetOf(column.slot);
      if (to > at) continue;
      H.block(at, to, row.dimension, column.dimension) +=
          prior_H.block(row.offset, column.offset, row.dimension, column.dimension);
    }
    for (int k = 0; k < row.dimension; ++k) {
      double force = 0;
      for (int m = 0; m < prior.dimension(); ++m) force += prior_H(m, row.offset + k) * deviation[m];
      const double b = prior.b()[row.offset + k];
      g[at + k] += b + force;
      cost += deviation[row.offset + k] * (b + 0.5 * force);
    }
  }
  return cost;
}

void addMotion(const WindowProblem& problem, std::size_t position, NormalEquations& system) {
  MotionFactor factor;
  if (position == 0 || !motionFactor(problem, position, factor)) return;
  const WindowState& i = problem.window[position - 1];
  const WindowState& j = problem.window[position];
  system.addMotion(factor, i, j, problem.intrinsics.offset());
  addRest(i, j, system);
}

MotionResiduals motionResiduals(const WindowProblem& problem) {
  MotionResiduals result;
  double rows = 0;
  SensorResiduals gyro;
  SensorResiduals accel;
  for (std::size_t k = problem.window.size(); k-- > 1;) {
    MotionFactor factor;
    if (!motionFactor(problem, k, factor)) continue;
    const WindowState& state = problem.window[k];
    result.all += factor.residual.squaredNorm();
    rows += static_cast<double>(factor.residual.size());
    if (state.link != LinkKind::kImu) continue;
    if ((problem.window.newest().stamp - state.stamp).seconds() >= kResidualTime) continue;
    // Whitening is lower triangular and rotation comes first, so these residuals depend only on the gyro.
    gyro.add(state.imu_factors.gyro * factor.residual.head<3>(), state.link_duration);
    accel.add(state.imu_factors.accel * factor.residual.segment<3>(6), state.link_duration);
  }
  if (rows > 0) result.all /= rows;
  result.gyro = gyro.meanSquare();
  result.accel = accel.meanSquare();
  return result;
}

void addExtras(const WindowProblem& problem, NormalEquations& system) {
  for (const ExtraState& extra : problem.extras.states()) {
    if (extra.isLandmark()) addSightings(problem, extra, problem.landmarks[extra.landmark].views(), system);
  }
  for (const ExtraFactor& factor : problem.extras.factors()) {
    if (problem.extras.counts(factor)) addFactor(problem, factor, system);
  }
}

// The sigma of a landmark's inverse depth is along its first ray with everything else held fixed, as in
// triangulation.
void finishExtras(WindowProblem& problem, NormalEquations& system) {
  MatrixMap H = system.H();
  for (const ExtraState& extra : problem.extras.states()) {
    if (extra.kind == ExtraKind::kNone) continue;
    for (int k = 0; k < kExtraDim; ++k) H(extra.offset + k, extra.offset + k) += kWeakInformation;
    if (!extra.isLandmark()) continue;
    LandmarkPoint& point = problem.landmarks[extra.landmark].point;
    const Eigen::Matrix3d lower = H.block<kExtraDim, kExtraDim>(extra.offset, extra.offset);
    const Eigen::Matrix3d information = lower.selfadjointView<Eigen::Lower>();
    const double variance = point.bearing.dot(information.llt().solve(point.bearing));
    point.inverse_depth_sigma =
        point.inverse_depth * point.inverse_depth * std::sqrt(std::max(variance, 0.0));
  }
}

void addDepartingExtras(const WindowProblem& problem, const std::uint8_t* slot, NormalEquations& system) {
  for (const ExtraState& extra : problem.extras.states()) {
    if (!extra.isLandmark()) continue;
    const std::span<const Sighting> sightings = problem.landmarks[extra.landmark].views();
    if (extra.leaving) {
      addSightings(problem, extra, sightings, system);
    } else if (slot != nullptr) {
      const auto at = std::ranges::find(sightings, *slot, &Sighting::slot);
      if (at != sightings.end()) addSightings(problem, extra, {at, 1}, system);
    }
  }
  for (const ExtraFactor& factor : problem.extras.factors()) {
    if (problem.extras.departs(factor) && problem.extras.counts(factor)) addFactor(problem, factor, system);
  }
}

WindowCost costOf(WindowProblem& problem, std::vector<double>& work) {
  WindowCost cost;
  if (!problem.prior.empty()) {
    const VectorMap d = priorDeviation(problem, work);
    cost.prior = problem.prior.b().dot(d) + 0.5 * d.dot(problem.prior.H().lazyProduct(d));
  }
  for (std::size_t k = 1; k < problem.window.size(); ++k) {
    MotionFactor factor;
    if (!motionFactor(problem, k, factor)) continue;
    const WindowState& i = problem.window[k - 1];
    const WindowState& j = problem.window[k];
    double squares = factor.residual.squaredNorm();
    if (j.rest != 0) squares += (j.x.v_world_body / kRestVelocitySigma).squaredNorm();
    if (j.rest != 0 && i.rest == j.rest) squares += restResidual(i, j).squaredNorm();
    cost.factors += 0.5 * squares;
  }
  for (const Landmark& landmark : problem.landmarks) {
    // The point of an explicit landmark follows its state.
    if (landmark.in_system)
      cost.factors += PointViews(problem.rig_poses, landmark.views()).cost(landmark.point);
  }
  LinearFactor linear;
  for (const ExtraFactor& factor : problem.extras.factors()) {
    if (!problem.extras.counts(factor)) continue;
    problem.extras.linearize(factor, linear);
    cost.factors += linear.cost;
  }
  return cost;
}

}  // namespace swiftlet
