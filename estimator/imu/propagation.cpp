#include "estimator/imu/propagation.hpp"

#include <algorithm>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Rows (and columns) of the 15-vector.
constexpr int kTheta = 0;
constexpr int kPosition = 3;
constexpr int kVelocity = 6;
constexpr int kBiasGyro = 9;
constexpr int kBiasAccel = 12;

// The blocks of one step's transition that are not identity.
struct Transition {
  double dt;
  Eigen::Vector3d force;       // mean specific force, world axes
  Eigen::Matrix3d theta_bias;  // d theta' / d bg
  Eigen::Matrix3d half_bias;   // d theta at the step's middle / d bg
  Eigen::Matrix3d v_bias;      // d v' / d ba
};

// Phi X for 15 x 15 X.
Matrix15d transition(const Transition& t, const Matrix15d& x) {
  using Rows = Eigen::Matrix<double, 3, kStateDim>;
  const Rows bias_gyro = x.middleRows<3>(kBiasGyro);
  const Rows half = x.middleRows<3>(kTheta) + t.half_bias * bias_gyro;
  const Eigen::Vector3d a = t.dt * t.force;
  Rows v = x.middleRows<3>(kVelocity) + t.v_bias * x.middleRows<3>(kBiasAccel);
  v.row(0) -= a.y() * half.row(2) - a.z() * half.row(1);
  v.row(1) -= a.z() * half.row(0) - a.x() * half.row(2);
  v.row(2) -= a.x() * half.row(1) - a.y() * half.row(0);
  Matrix15d out = x;
  out.middleRows<3>(kTheta) += t.theta_bias * bias_gyro;
  out.middleRows<3>(kPosition) += (0.5 * t.dt) * (x.middleRows<3>(kVelocity) + v);
  out.middleRows<3>(kVelocity) = v;
  return out;
}

// Integrals over a step: int t = dt^2 / 2 and int t^2 = dt^3 / 3.
void addWhiteAcceleration(Matrix15d& P, double variance, double dt) {
  for (int i = 0; i < 3; ++i) {
    P(kVelocity + i, kVelocity + i) += variance;
    P(kPosition + i, kVelocity + i) += 0.5 * dt * variance;
    P(kVelocity + i, kPosition + i) += 0.5 * dt * variance;
    P(kPosition + i, kPosition + i) += dt * dt / 3.0 * variance;
  }
}

void addWalks(Matrix15d& P, const ImuNoise& noise, double dt) {
  P.diagonal().segment<3>(kBiasGyro).array() += noise.gyro_walk * noise.gyro_walk * dt;
  P.diagonal().segment<3>(kBiasAccel).array() += noise.accel_walk * noise.accel_walk * dt;
}

// Rotates the axes of the rotation error: rows and columns by R.
void turnRotationError(Matrix15d& P, const Eigen::Matrix3d& R) {
  P.topRows<3>() = (R * P.topRows<3>()).eval();
  P.leftCols<3>() = (P.leftCols<3>() * R.transpose()).eval();
}

bool finite(const NavState& state) {
  return state.T_world_body.rotation.coeffs().allFinite() && state.T_world_body.translation.allFinite() &&
         state.v_world_body.allFinite() && state.bias_gyro.allFinite() && state.bias_accel.allFinite() &&
         state.covariance.allFinite();
}

}  // namespace

void Propagator::Current::set(const NavState& state, const GyroIntrinsics& gyro) {
  nav = state;
  intrinsics = gyro;
  turnRotationError(nav.covariance, nav.T_world_body.R());
  gap_seconds = 0;
}

NavState Propagator::Current::toNavState() const {
  NavState out = nav;
  turnRotationError(out.covariance, nav.T_world_body.R().transpose());
  return out;
}

void Propagator::Current::advance(const ImuSample* before, const ImuSample* after, Stamp to,
                                  const ImuNoise& noise) {
  const ImuSegment segment = makeSegment(before, after, nav.stamp, to, noise);
  if (segment.gap) {
    advanceGap(segment.dt, noise);
  } else {
    advanceMeasured(segment, noise);
  }
  nav.stamp = to;
}

void Propagator::Current::advanceMeasured(const ImuSegment& segment, const ImuNoise& noise) {
  const double dt = segment.dt;
  const Eigen::Matrix3d R = nav.T_world_body.R();
  const IntegrationStep step = integrationStep((intrinsics.rate(segment.gyro) - nav.bias_gyro) * dt);
  const Eigen::Quaterniond middle = nav.T_world_body.rotation * step.half;
  const Eigen::Matrix3d R_half = middle.toRotationMatrix();
  const Eigen::Vector3d force = R_half * (segment.accel - nav.bias_accel);

  // Half of the rate's variance is added before the step, half after it, as in Preintegration.
  Matrix15d& P = nav.covariance;
  const double gyro_variance = segment.gyro_factor * noise.gyro_density * noise.gyro_density * dt;
  P.diagonal().segment<3>(kTheta).array() += 0.5 * gyro_variance;
  const Transition t{dt, force, -dt * R * step.left_jacobian, (-0.5 * dt) * R * step.half_left_jacobian,
                     -dt * R_half};
  P = transition(t, transition(t, P).transpose());
  P.diagonal().segment<3>(kTheta).array() += 0.5 * gyro_variance;
  addWhiteAcceleration(P, segment.accel_factor * noise.accel_density * noise.accel_density * dt, dt);
  addWalks(P, noise, dt);

  const Eigen::Vector3d acceleration = force - Eigen::Vector3d(0, 0, noise.gravity);
  nav.T_world_body.translation += nav.v_world_body * dt + 0.5 * dt * dt * acceleration;
  nav.v_world_body += dt * acceleration;
  nav.T_world_body.rotation = (middle * step.half).normalized();
}

void Propagator::Current::advanceGap(double dt, const ImuNoise& noise) {
  Matrix15d& P = nav.covariance;
  const Transition t{dt, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(),
                     Eigen::Matrix3d::Zero()};
  P = transition(t, transition(t, P).transpose());
  P.diagonal().segment<3>(kTheta).array() += kGapGyroDensity * kGapGyroDensity * dt;
  addWhiteAcceleration(P, kGapAccelDensity * kGapAccelDensity * dt, dt);
  addWalks(P, noise, dt);
  nav.T_world_body.translation += nav.v_world_body * dt;
  gap_seconds += dt;
}

Status Propagator::setState(const NavState& state, const GyroIntrinsics& intrinsics) {
  if (!finite(state)) return {StatusCode::kInvalidInput, "state to propagate from is not finite"};
  given_.set(state, intrinsics);
  current_ = given_;
  has_state_ = true;
  const std::uint64_t oldest = oldestKept();
  const std::uint64_t next = firstAfter(state.stamp);
  if (next < count_) advance(current_, sampleAt(count_ - 1).stamp);
  if (next == oldest && oldest > 0) {
    return {StatusCode::kCapacityReached, "state older than the kept IMU samples"};
  }
  return okStatus();
}

std::uint64_t Propagator::firstAfter(Stamp stamp) const {
  std::uint64_t next = count_;
  while (next > oldestKept() && sampleAt(next - 1).stamp > stamp) --next;
  return next;
}

void Propagator::advance(Current& state, Stamp to) const {
  for (std::uint64_t next = firstAfter(state.nav.stamp); state.nav.stamp < to; ++next) {
    const ImuSample* before = next > oldestKept() ? &sampleAt(next - 1) : nullptr;
    const ImuSample* after = next < count_ ? &sampleAt(next) : nullptr;
    state.advance(before, after, after != nullptr ? std::min(to, after->stamp) : to, noise_);
  }
}

Status Propagator::step(const ImuSample& sample, NavState* state) {
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    return {StatusCode::kInvalidInput, "IMU sample is not finite"};
  }
  const ImuSample* before = count_ > 0 ? &sampleAt(count_ - 1) : nullptr;
  if (before != nullptr && sample.stamp <= before->stamp) {
    return {StatusCode::kInvalidInput, "IMU stamp repeated or reversed"};
  }
  if (has_state_ && sample.stamp > current_.nav.stamp) {
    current_.advance(before, &sample, sample.stamp, noise_);
  }
  ring_[count_ % kRing] = sample;
  ++count_;
  if (!has_state_) return {StatusCode::kNotReady, "no state to propagate from yet"};
  if (state != nullptr) *state = current_.toNavState();
  return okStatus();
}

Status Propagator::predict(Stamp at, NavState& state) const {
  if (!has_state_ || count_ == 0) return {StatusCode::kNotReady, "no state or no sample to predict from"};
  if (at < given_.nav.stamp) {
    return {StatusCode::kInvalidInput, "a prediction was requested for before the newest state set"};
  }
  Current moved = at < current_.nav.stamp ? given_ : current_;
  advance(moved, at);
  state = moved.toNavState();
  return okStatus();
}

void Propagator::reset() {
  has_state_ = false;
  count_ = 0;
  given_ = current_ = Current{};
}

}  // namespace swiftlet
