#pragma once
// The fixed-lag smoother on a simulated flight, started from the true state within the start's sigmas.

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/alignment.hpp"
#include "estimator/smoother/smoother.hpp"
#include "tests/smoother/track_flight.hpp"

namespace swiftlet::test {

/// Settings that match the flight's own noise.
inline SmootherSettings settingsFor(const TrackFlight& flight) {
  SmootherSettings settings;
  settings.pixel_sigma = flight.flight().settings().tracks.pixel_sigma;
  return settings;
}

class SmootherRun {
 public:
  explicit SmootherRun(const TrackFlight& flight) : SmootherRun(flight, settingsFor(flight)) {}
  SmootherRun(const TrackFlight& flight, const SmootherSettings& settings)
      : flight_(flight), smoother_(std::make_unique<Smoother>(flight.rig(), flight.noise(), settings)) {}

  void addImu(const ImuSample& sample) { smoother_->addImu(sample); }

  // Of the steps to come.
  double pose_tolerance = Smoother::StepInput{}.pose_tolerance;
  int max_features = static_cast<int>(kMaxFeatures);
  int max_keyframes = static_cast<int>(kMaxStates);

  Status step(std::size_t k, int iterations = 3) {
    if (!smoother_->started()) start(k);
    Smoother::StepInput input;
    input.frame = &flight_.frames()[k];
    input.iterations = k < 20 ? std::max(iterations, 8) : iterations;  // the start needs more
    input.pose_tolerance = pose_tolerance;
    input.max_features = max_features;
    input.max_keyframes = max_keyframes;
    const Status status = smoother_->step(input);
    smoother_->trim(left_);
    return status;
  }

  [[nodiscard]] Smoother& smoother() { return *smoother_; }
  [[nodiscard]] const FixedVector<KeyframeState, kMaxStates>& left() const { return left_; }

 private:
  void start(std::size_t k) {
    Random random(flight_.flight().settings().seed, 77);
    const auto normal = [&random](double sigma) {
      return Eigen::Vector3d(sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
    };
    StartState start;
    start.state = flight_.truth(k);
    start.tilt_sigma = 0.02;
    start.velocity_sigma = 0.1;
    start.gyro_bias_sigma = 0.02;
    start.accel_bias_sigma = 0.08;
    // Errors drawn from the start's own sigmas; position and yaw define the world and have none.
    Eigen::Vector3d tilt = normal(start.tilt_sigma);
    tilt.z() = 0;
    const Eigen::Quaterniond R = start.state.T_world_body.rotation;
    start.state.T_world_body.rotation = expSo3(tilt) * R;
    start.state.v_world_body += normal(start.velocity_sigma);
    start.state.bias_gyro += normal(start.gyro_bias_sigma);
    start.state.bias_accel += normal(start.accel_bias_sigma);
    smoother_->start(start);
  }
  static Eigen::Quaterniond expSo3(const Eigen::Vector3d& phi) {
    const double angle = phi.norm();
    if (angle < 1e-12) return Eigen::Quaterniond::Identity();
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, phi / angle));
  }

  const TrackFlight& flight_;
  std::unique_ptr<Smoother> smoother_;
  FixedVector<KeyframeState, kMaxStates> left_;
};

/// RMS of the positions' error after a rigid alignment [m].
inline double positionError(std::span<const NavState> estimate, std::span<const BodyState> truth) {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    from.push_back(estimate[k].T_world_body.translation);
    to.push_back(truth[k].T_world_body.translation);
  }
  Alignment alignment;
  if (!alignRigid(from, to, alignment).ok()) return std::nan("");
  return alignment.rms;
}

/// Directions of a state that nothing but the start prior knows: shifts and a turn about gravity of the
/// whole window.
inline Eigen::Matrix<double, kStateDim, 4> unobservable(const BodyState& x) {
  Eigen::Matrix<double, kStateDim, 4> N = Eigen::Matrix<double, kStateDim, 4>::Zero();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  N.block<3, 3>(3, 0).setIdentity();
  N.block<3, 1>(0, 3) = x.T_world_body.rotation.conjugate() * z;
  N.block<3, 1>(3, 3) = z.cross(x.T_world_body.translation);
  N.block<3, 1>(6, 3) = z.cross(x.v_world_body);
  return N;
}

}  // namespace swiftlet::test
