#pragma once
// Rotations of a camera between images, and the gyro's rotations at the same times.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"

namespace swiftlet {

struct CameraTurn {
  double from = 0;  ///< s, stamp of the first image since `origin`
  double to = 0;
  std::size_t first = 0;  ///< indices of the images
  std::size_t last = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  ///< rotation vector [rad] in the camera's axes
};

/// Rotations between consecutive images at least kLeastTurnTime apart, by RANSAC over the five-point problem,
/// so the motion need not be known. Pairs without consensus are omitted.
std::vector<CameraTurn> cameraTurns(const std::vector<TrackedImage>& images, const CameraModel& camera,
                                    Stamp origin);
inline constexpr double kLeastTurnTime = 0.08;  // s; longer turns exceed the noise of the tracks

/// Integral of the rates from the first sample on. Components are summed, which is a rotation only for the
/// small angles between images, but also works for a gyro in any unit and any axes.
class GyroIntegral {
 public:
  GyroIntegral(const std::vector<ImuSample>& samples, Stamp origin);
  [[nodiscard]] bool covers(double from, double to) const {
    return !times_.empty() && from >= times_.front() && to <= times_.back();
  }
  [[nodiscard]] Eigen::Vector3d at(double time) const;
  [[nodiscard]] double begin() const { return times_.front(); }
  [[nodiscard]] double end() const { return times_.back(); }

 private:
  std::vector<double> times_;
  std::vector<Eigen::Vector3d> sums_;
};

}  // namespace swiftlet
