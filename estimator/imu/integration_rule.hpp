#pragma once
// The one integration rule of the IMU, shared by preintegration and propagation.
//
// A segment is a stretch of time between two stamps with at most one sample on either side:
// readings are linear between samples and held beyond the last. Its mean rate and mean force move
// the state; what the data do not cover raises the noise, and a gap is not integrated at all.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/core/stamp.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Up to so many periods between samples count as regular (jitter).
inline constexpr double kRegularPeriods = 1.5;
/// Beyond so many periods without a sample the stretch is a gap (50 ms at 200 Hz: the motion in
/// between is no longer told by its ends).
inline constexpr double kGapPeriods = 10.0;
/// White acceleration that stands for the unknown motion in a gap: 3 m/s after one second, m/s^2/sqrt(Hz).
inline constexpr double kGapAccelDensity = 3.0;
/// Likewise for the rate: half a radian after one second, rad/s/sqrt(Hz).
inline constexpr double kGapGyroDensity = 0.5;
/// A saturated reading is only a lower bound: its noise is raised a hundredfold.
inline constexpr double kSaturatedVarianceFactor = 1e4;

struct ImuSegment {
  double dt = 0;                                   ///< s
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< mean over the segment, bias included
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  double gyro_factor = 1;  ///< on the variance
  double accel_factor = 1;
  bool gap = false;  ///< the means are the readings at the gap's ends; do not trust them
};

/// The segment [from, to] between `before` (not after `from`) and `after` (not before `to`), one of
/// which may be null: then the other's reading is held.
ImuSegment makeSegment(const ImuSample* before, const ImuSample* after, Stamp from, Stamp to,
                       const ImuNoise& noise);

/// One step of the rule: attitude at the middle and the end, mean force in the start's axes.
struct IntegrationStep {
  Eigen::Quaterniond half;        ///< Exp(gyro dt / 2)
  Eigen::Matrix3d left_jacobian;  ///< Jl(gyro dt): Exp(phi + d) = Exp(Jl d) Exp(phi)
  Eigen::Matrix3d half_left_jacobian;
};

/// `rotation`: rate dt, rad.
IntegrationStep integrationStep(const Eigen::Vector3d& rotation);

}  // namespace swiftlet
