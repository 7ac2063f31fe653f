#pragma once
// The integration rule of the IMU, shared by preintegration and propagation.
//
// A segment is an interval between two stamps with at most one sample on either side. Readings are linear
// between samples and held after the last one. The mean rate and mean force of a segment move the state. Time
// not covered by data increases the noise; a gap is not integrated.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/core/stamp.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Largest interval between samples that counts as regular (jitter) [periods].
inline constexpr double kRegularPeriods = 1.5;
/// Longer intervals without a sample are gaps [periods]. 50 ms at 200 Hz: the readings at the ends no longer
/// describe the motion between them.
inline constexpr double kGapPeriods = 10.0;
/// White acceleration that models unknown motion in a gap: 3 m/s after one second, m/s^2/sqrt(Hz).
inline constexpr double kGapAccelDensity = 3.0;
/// White rate that models unknown rotation in a gap: half a radian after one second, rad/s/sqrt(Hz).
inline constexpr double kGapGyroDensity = 0.5;
/// Factor on the noise variance of a saturated reading, which is only a lower bound: 100 times the noise.
inline constexpr double kSaturatedVarianceFactor = 1e4;

struct ImuSegment {
  double dt = 0;                                   ///< s
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< mean over the segment, bias included
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  double gyro_factor = 1;  ///< on the variance
  double accel_factor = 1;
  bool gap = false;  ///< the means are only those of the readings at the ends of the gap
};

/// The segment [from, to] between `before` (not after `from`) and `after` (not before `to`). One of them may
/// be null; the reading of the other is then held.
ImuSegment makeSegment(const ImuSample* before, const ImuSample* after, Stamp from, Stamp to,
                       const ImuNoise& noise);

/// One step of the rule: attitude at middle and end, mean force in the axes of the start.
struct IntegrationStep {
  Eigen::Quaterniond half;        ///< Exp(gyro dt / 2)
  Eigen::Matrix3d left_jacobian;  ///< Jl(gyro dt): Exp(phi + d) = Exp(Jl d) Exp(phi)
  Eigen::Matrix3d half_left_jacobian;
};

/// `rotation`: rate dt, rad.
IntegrationStep integrationStep(const Eigen::Vector3d& rotation);

}  // namespace swiftlet
