#include "drivers/simulated/spline_trajectory.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kOrder = SplineTrajectory::kOrder;
using Weights = std::array<double, kOrder>;

// The iteration that makes the spline pass through given poses multiplies the error by at most 1 - 16/120
// each time (smallest eigenvalue of the collocation matrix): 1e-9 remains after 150.
constexpr int kInterpolationSteps = 150;

struct Basis {
  Weights value{};
  Weights first{};   // d / du
  Weights second{};  // d^2 / du^2
};

// Weights of the p + 1 controls of a segment for degree p, raised one degree at a time; degrees
// 3 and 4 give the second and first derivatives of degree 5.
Basis basisAt(double u) {
  Weights b{1.0};
  Basis basis;
  for (std::size_t degree = 1; degree < kOrder; ++degree) {
    const auto p = static_cast<double>(degree);
    Weights next{};
    for (std::size_t l = 0; l <= degree; ++l) {
      const auto index = static_cast<double>(l);
      const double older = l > 0 ? (u + p - index) * b[l - 1] : 0.0;
      const double newer = l < degree ? (index + 1.0 - u) * b[l] : 0.0;
      next[l] = (older + newer) / p;
    }
    b = next;
    if (degree == 3) {
      for (std::size_t l = 0; l < kOrder; ++l) {
        basis.second[l] = (l > 1 ? b[l - 2] : 0.0) - 2.0 * (l > 0 ? b[l - 1] : 0.0) + b[l];
      }
    } else if (degree == 4) {
      for (std::size_t l = 0; l < kOrder; ++l) basis.first[l] = (l > 0 ? b[l - 1] : 0.0) - b[l];
    }
  }
  basis.value = b;
  return basis;
}

// Turns weights into cumulative weights: entry j is the sum of entries j to the end.
void accumulate(Weights& weights) {
  for (std::size_t l = kOrder - 1; l-- > 0;) weights[l] += weights[l + 1];
}

}  // namespace

SplineTrajectory::SplineTrajectory(double start, double spacing, std::vector<SE3> controls)
    : start_(start), spacing_(spacing), controls_(std::move(controls)) {
  assert(controls_.size() >= kOrder && spacing_ > 0);
}

SplineTrajectory SplineTrajectory::interpolate(double start, double spacing,
                                               const std::vector<SE3>& samples) {
  assert(samples.size() >= 2);
  const std::size_t count = samples.size();
  std::vector<SE3> controls(count + kOrder - 2);
  // Beyond the ends the motion is reflected through the end pose.
  const auto extend = [&] {
    for (std::size_t k = 1; k <= kCentreOffset; ++k) {
      const SE3& end = controls[kCentreOffset];
      const SE3& inside = controls[kCentreOffset + std::min(k, count - 1)];
      controls[kCentreOffset - k] = SE3(end.rotation * (inside.rotation.conjugate() * end.rotation),
                                        2.0 * end.translation - inside.translation);
    }
    const std::size_t last = kCentreOffset + count - 1;
    for (std::size_t k = 1; last + k < controls.size(); ++k) {
      const SE3& end = controls[last];
      const SE3& inside = controls[last - std::min(k, count - 1)];
      controls[last + k] = SE3(end.rotation * (inside.rotation.conjugate() * end.rotation),
                               2.0 * end.translation - inside.translation);
    }
  };
  for (std::size_t k = 0; k < count; ++k) controls[k + kCentreOffset] = samples[k];
  extend();

  SplineTrajectory spline(start, spacing, controls);
  for (int step = 0; step < kInterpolationSteps; ++step) {
    double largest = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const SE3 now = spline.pose(start + spacing * static_cast<double>(k));
      const Eigen::Vector3d shift = samples[k].translation - now.translation;
      const Eigen::Vector3d turn = logSo3(now.rotation.conjugate() * samples[k].rotation);
      SE3& control = controls[k + kCentreOffset];
      control = SE3(control.rotation * expSo3(turn), control.translation + shift);
      largest = std::max({largest, shift.norm(), turn.norm()});
    }
    extend();
    spline.controls_ = controls;
    if (largest < 1e-12) break;
  }
  return spline;
}

SplineTrajectory::Segment SplineTrajectory::segmentOf(double seconds) const {
  const auto segments = static_cast<double>(controls_.size() + 1 - kOrder);
  const double place = std::clamp((seconds - start_) / spacing_, 0.0, segments);
  const double first = std::min(std::floor(place), segments - 1.0);
  return {static_cast<std::size_t>(first), place - first};
}

SE3 SplineTrajectory::pose(double seconds) const { return at(seconds).T_world_body; }

MotionState SplineTrajectory::at(double seconds) const {
  const Segment segment = segmentOf(seconds);
  Basis basis = basisAt(segment.u);
  const double rate = 1.0 / spacing_;
  const SE3* control = controls_.data() + segment.first;

  MotionState state;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (std::size_t l = 0; l < kOrder; ++l) {
    position += basis.value[l] * control[l].translation;
    state.v_world_body += basis.first[l] * rate * control[l].translation;
    state.a_world_body += basis.second[l] * rate * rate * control[l].translation;
  }

  accumulate(basis.value);
  accumulate(basis.first);
  accumulate(basis.second);
  Eigen::Quaterniond rotation = control[0].rotation;
  for (std::size_t l = 1; l < kOrder; ++l) {
    const Eigen::Vector3d step = logSo3(control[l - 1].rotation.conjugate() * control[l].rotation);
    const Eigen::Quaterniond turn = expSo3(basis.value[l] * step);
    const double speed = basis.first[l] * rate;
    const Eigen::Vector3d carried = turn.conjugate() * state.omega_body;
    state.alpha_body = turn.conjugate() * state.alpha_body + speed * carried.cross(step) +
                       basis.second[l] * rate * rate * step;
    state.omega_body = carried + speed * step;
    rotation = rotation * turn;
  }
  state.T_world_body = SE3(rotation, position);
  return state;
}

MotionState SplineTrajectory::at(double seconds, SplineJacobian& jacobian) const {
  const Segment segment = segmentOf(seconds);
  Basis basis = basisAt(segment.u);
  const double per_second = 1.0 / spacing_;
  const SE3* control = controls_.data() + segment.first;
  jacobian.first = segment.first;
  jacobian.position = basis.value;
  for (std::size_t l = 0; l < kOrder; ++l) {
    jacobian.acceleration[l] = basis.second[l] * per_second * per_second;
  }
  accumulate(basis.value);
  accumulate(basis.first);

  // Derivatives by the steps between controls; those before step l are rotated by each later step.
  std::array<Eigen::Matrix3d, kOrder> turn_by_step;
  std::array<Eigen::Matrix3d, kOrder> rate_by_step;
  std::array<Eigen::Vector3d, kOrder> steps;
  std::array<Eigen::Matrix3d, kOrder> between;
  std::array<Eigen::Matrix3d, kOrder> back;
  Eigen::Vector3d omega = Eigen::Vector3d::Zero();
  for (std::size_t l = 1; l < kOrder; ++l) {
    between[l] = (control[l - 1].rotation.conjugate() * control[l].rotation).toRotationMatrix();
    steps[l] = logSo3(between[l]);
    const Eigen::Vector3d turn = basis.value[l] * steps[l];
    back[l] = expSo3Matrix(-turn);
    const Eigen::Vector3d carried = back[l] * omega;
    const double speed = basis.first[l] * per_second;
    turn_by_step[l] = basis.value[l] * rightJacobianSo3(turn);
    rate_by_step[l] = hat(carried) * turn_by_step[l] + speed * Eigen::Matrix3d::Identity();
    omega = carried + speed * steps[l];
  }
  Eigen::Matrix3d later = Eigen::Matrix3d::Identity();  // inverse of all rotations after step l
  std::array<Eigen::Matrix3d, kOrder>& turns = jacobian.rotation;
  std::array<Eigen::Matrix3d, kOrder>& rates = jacobian.rate;
  for (std::size_t l = 0; l < kOrder; ++l) {
    turns[l].setZero();
    rates[l].setZero();
  }
  for (std::size_t l = kOrder - 1; l > 0; --l) {
    const Eigen::Matrix3d inverse = rightJacobianInverseSo3(steps[l]);
    const Eigen::Matrix3d by_turn = later * turn_by_step[l] * inverse;
    const Eigen::Matrix3d by_rate = later * rate_by_step[l] * inverse;
    turns[l] += by_turn;
    rates[l] += by_rate;
    turns[l - 1] -= by_turn * between[l].transpose();
    rates[l - 1] -= by_rate * between[l].transpose();
    later = later * back[l];
  }
  turns[0] += later;
  return at(seconds);
}

}  // namespace swiftlet
