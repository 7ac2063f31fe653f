#include "firmware_host/inspection/motion_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kFewestTurns = 25;
constexpr double kCoarseStep = 0.02;  // s; a vehicle's turn rates change more slowly
constexpr double kFineStep = 0.001;   // s
constexpr int kRobustRounds = 4;
constexpr double kCauchy = 2.4;  // sigmas; 95 % efficient for normal errors
constexpr double kToDegrees = 180 / std::numbers::pi;
constexpr double kFastest = 12;  // rad/s; no camera tracks features through faster turns

}  // namespace

/// Weighted sums over all turns covered by samples. Regressors: the gyro's turn (3) and the time.
struct MotionFitter::Sums {
  Eigen::Matrix4d xx = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 3, 4> yx = Eigen::Matrix<double, 3, 4>::Zero();
  double yy = 0;
  double weight = 0;
  std::size_t count = 0;
  Eigen::Vector3d yt = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Matrix<double, 3, 4> solution() const {
    Eigen::Matrix4d regular = xx;
    regular.diagonal().array() += 1e-12 * xx.trace();
    return regular.ldlt().solve(yx.transpose()).transpose();
  }
  [[nodiscard]] double left() const { return std::max(yy - (solution().cwiseProduct(yx)).sum(), 0.0); }
  /// Variance without the gyro, with a constant rate only.
  [[nodiscard]] double whole() const {
    return std::max(yy - (xx(3, 3) > 0 ? yx.col(3).squaredNorm() / xx(3, 3) : 0.0), 0.0);
  }
  [[nodiscard]] double gain() const {
    constexpr double kLeast = 1e-12;
    return 1.5 * weight * std::log((whole() + kLeast) / (left() + kLeast));
  }
};

MotionFitter::MotionFitter(const std::vector<CameraTurn>& turns, const GyroIntegral& gyro)
    : turns_(turns), gyro_(gyro) {}

Eigen::Vector3d MotionFitter::gyroTurn(const CameraTurn& turn, double shift) const {
  return gyro_.at(turn.to + shift) - gyro_.at(turn.from + shift);
}

MotionFitter::Sums MotionFitter::sumsAt(double shift, const std::vector<double>& weights) const {
  Sums sums;
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    const CameraTurn& turn = turns_[k];
    if (weights[k] <= 0 || !gyro_.covers(turn.from + shift, turn.to + shift)) continue;
    const double seconds = turn.to - turn.from;
    Eigen::Vector4d x;
    x << gyroTurn(turn, shift), seconds;
    sums.xx += weights[k] * x * x.transpose();
    sums.yx += weights[k] * turn.turn * x.transpose();
    sums.yy += weights[k] * turn.turn.squaredNorm();
    sums.weight += weights[k];
    ++sums.count;
  }
  return sums;
}

std::vector<double> MotionFitter::robustWeights(double shift, const Sums& sums) const {
  const Eigen::Matrix<double, 3, 4> M = sums.solution();
  std::vector<double> errors(turns_.size(), -1);
  std::vector<double> sorted;
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    const CameraTurn& turn = turns_[k];
    if (!gyro_.covers(turn.from + shift, turn.to + shift)) continue;
    Eigen::Vector4d x;
    x << gyroTurn(turn, shift), turn.to - turn.from;
    errors[k] = (turn.turn - M * x).norm();
    sorted.push_back(errors[k]);
  }
  std::vector<double> weights(turns_.size(), 0);
  if (sorted.empty()) return weights;
  // The median norm of a normal error in three axes is 1.54 sigma.
  const double sigma = std::max(medianOf(sorted) / 1.54, 1e-6);
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    if (errors[k] < 0) continue;
    const double ratio = errors[k] / (kCauchy * sigma);
    weights[k] = 1 / (1 + ratio * ratio);
  }
  return weights;
}

double MotionFitter::scan(const std::vector<double>& weights, double begin, double end, double step) const {
  double best = begin;
  double most = -1;
  for (double shift = begin; shift <= end + 0.5 * step; shift += step) {
    const Sums sums = sumsAt(shift, weights);
    if (sums.count < kFewestTurns || 2 * sums.count < turns_.size()) continue;
    const double gain = sums.gain();
    if (gain > most) {
      most = gain;
      best = shift;
    }
  }
  return best;
}

std::optional<MotionFit> MotionFitter::fit(double calibrated_shift) {
  std::vector<double> weights(turns_.size(), 0);
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    const double seconds = turns_[k].to - turns_[k].from;
    weights[k] = turns_[k].turn.norm() < kFastest * seconds ? 1 : 0;
  }
  // First the whole range, again after false turns are down-weighted.
  double shift = scan(weights, calibrated_shift - kMaxShift, calibrated_shift + kMaxShift, kCoarseStep);
  Sums sums = sumsAt(shift, weights);
  if (sums.count < kFewestTurns) return {};
  for (int round = 0; round < kRobustRounds; ++round) {
    weights = robustWeights(shift, sums);
    if (round == 0)
      shift = scan(weights, calibrated_shift - kMaxShift, calibrated_shift + kMaxShift, kCoarseStep);
    shift = scan(weights, shift - kCoarseStep, shift + kCoarseStep, kFineStep);
    sums = sumsAt(shift, weights);
    if (sums.count < kFewestTurns) return {};
  }
  double slope = 0;
  for (int round = 0; round < kRobustRounds; ++round) {
    const double step = shiftStep(shift, weights, sums, slope);
    shift += std::clamp(step, -kFineStep, kFineStep);
    sums = sumsAt(shift, weights);
    weights = robustWeights(shift, sums);
    sums = sumsAt(shift, weights);
  }
  MotionFit fit;
  fit.turns = sums.count;
  fit.shift = shift;
  fit.weights = weights;
  fit.weight = sums.weight;
  const double left = sums.left();
  fit.explained = sums.whole() > 0 ? 1 - left / sums.whole() : 0;
  fit.noise = std::sqrt(left / std::max(3 * sums.weight - 13, 1.0));
  fit.turned_deg = std::sqrt(sums.whole() / sums.weight) * kToDegrees;
  solveAxes(sums, fit);
  fit.shift_sigma = slope > 0 ? fit.noise / std::sqrt(slope) : kMaxShift;
  return fit;
}

double MotionFitter::shiftStep(double shift, const std::vector<double>& weights, const Sums& sums,
                               double& information) const {
  const Eigen::Matrix<double, 3, 4> M = sums.solution();
  double along = 0;
  information = 0;
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    const CameraTurn& turn = turns_[k];
    if (weights[k] <= 0 || !gyro_.covers(turn.from + shift, turn.to + shift)) continue;
    constexpr double kHalf = 0.005;  // s
    Eigen::Vector4d x;
    x << gyroTurn(turn, shift), turn.to - turn.from;
    const Eigen::Vector3d slope =
        M.leftCols<3>() * (gyroTurn(turn, shift + kHalf) - gyroTurn(turn, shift - kHalf)) / (2 * kHalf);
    along += weights[k] * slope.dot(turn.turn - M * x);
    information += weights[k] * slope.squaredNorm();
  }
  return information > 0 ? along / information : 0;
}

void MotionFitter::solveAxes(const Sums& sums, MotionFit& fit) const {
  // Eliminates the constant rate, which becomes the offset.
  const double time = std::max(sums.xx(3, 3), 1e-12);
  const Eigen::Vector3d g = sums.xx.topRightCorner<3, 1>();
  const Eigen::Vector3d y = sums.yx.col(3);
  const Eigen::Matrix3d H = sums.yx.leftCols<3>() - y * g.transpose() / time;
  const Eigen::Matrix3d G = sums.xx.topLeftCorner<3, 3>() - g * g.transpose() / time;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d d = svd.singularValues();
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const auto axes = [&](double last) -> Eigen::Matrix3d {
    return svd.matrixU() * Eigen::Vector3d(1, 1, last).asDiagonal() * svd.matrixV().transpose();
  };
  fit.R_cam_imu = axes(sign);
  fit.mirrored = axes(-sign);
  const double trace = std::max(G.trace(), 1e-12);
  const auto left = [&](double last) {
    const double agreement = d[0] + d[1] + last * d[2];
    return std::max(sums.whole() - agreement * agreement / trace, 1e-12);
  };
  fit.scale = (d[0] + d[1] + std::abs(d[2])) / trace;
  fit.mirror_gain = 1.5 * sums.weight * std::log(left(sign) / left(-sign));
  fit.offset = (y - fit.scale * fit.R_cam_imu * g) / time;
  // Residual variance under this model, which has fewer parameters.
  const double variance = left(sign) / std::max(3 * sums.weight - 8, 1.0);
  const Eigen::Matrix3d in_camera = fit.R_cam_imu * G * fit.R_cam_imu.transpose();
  fit.information = fit.scale * fit.scale * (in_camera.trace() * Eigen::Matrix3d::Identity() - in_camera) /
                    std::max(variance, 1e-12);
}

double MotionFitter::gainOverShift(const MotionFit& fit, double shift) const {
  const Sums best = sumsAt(fit.shift, fit.weights);
  const Sums other = sumsAt(shift, fit.weights);
  if (other.count < kFewestTurns) return best.gain();
  // Normalized per turn, so that a shift with fewer covered turns is not at a disadvantage.
  const double weight = std::min(best.weight, other.weight);
  return weight * (best.gain() / best.weight - other.gain() / other.weight);
}

double MotionFitter::gainOverAxes(const MotionFit& fit, const Eigen::Matrix3d& R_cam_imu) const {
  const Sums sums = sumsAt(fit.shift, fit.weights);
  const double time = std::max(sums.xx(3, 3), 1e-12);
  const Eigen::Vector3d g = sums.xx.topRightCorner<3, 1>();
  const Eigen::Vector3d y = sums.yx.col(3);
  const Eigen::Matrix3d H = sums.yx.leftCols<3>() - y * g.transpose() / time;
  const double trace = std::max((sums.xx.topLeftCorner<3, 3>() - g * g.transpose() / time).trace(), 1e-12);
  const auto left = [&](const Eigen::Matrix3d& axes) {
    const double agreement = std::max((axes.transpose() * H).trace(), 0.0);
    return std::max(sums.whole() - agreement * agreement / trace, 1e-12);
  };
  return 1.5 * sums.weight * std::log(left(R_cam_imu) / std::min(left(fit.R_cam_imu), left(fit.mirrored)));
}

MotionFitter::Evenness MotionFitter::evenness(const MotionFit& fit, const std::vector<double>& times) const {
  const Eigen::Matrix<double, 3, 4> M = sumsAt(fit.shift, fit.weights).solution();
  double dd = 0;
  double dr = 0;
  for (std::size_t k = 0; k < turns_.size(); ++k) {
    const CameraTurn& turn = turns_[k];
    if (fit.weights[k] <= 0) continue;
    CameraTurn even = turn;
    even.from = times[turn.first];
    even.to = times[turn.last];
    if (!gyro_.covers(even.from + fit.shift, even.to + fit.shift)) continue;
    Eigen::Vector4d x;
    x << gyroTurn(turn, fit.shift), turn.to - turn.from;
    Eigen::Vector4d x_even;
    x_even << gyroTurn(even, fit.shift), even.to - even.from;
    const Eigen::Vector3d difference = M * (x_even - x);
    dd += fit.weights[k] * difference.squaredNorm();
    dr += fit.weights[k] * difference.dot(turn.turn - M * x);
  }
  Evenness result;
  if (dd <= 0) return result;
  result.share = dr / dd;
  result.sigma = fit.noise / std::sqrt(dd);
  return result;
}

}  // namespace swiftlet
