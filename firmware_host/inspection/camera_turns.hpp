#pragma once
// How a camera turned between images, and what a gyro says of the same times.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"

namespace swiftlet {

struct CameraTurn {
  double from = 0;  ///< s of the image stamps since `origin`
  double to = 0;
  std::size_t first = 0;  ///< images
  std::size_t last = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  ///< rotation vector [rad] in the camera's axes
};

/// Turns between images that follow each other, at least kLeastTurnTime apart, by RANSAC of the five-point
/// problem: nothing of the motion has to be known. Pairs without consensus are left out.
std::vector<CameraTurn> cameraTurns(const std::vector<TrackedImage>& images, const CameraModel& camera,
                                    Stamp origin);
inline constexpr double kLeastTurnTime = 0.08;  // s: longer turns stand out of the tracks' noise

/// The integral of the rates from the first sample on. Components add up, which is a rotation for the small
/// angles between images only, but stays true to a gyro in any unit and any axes.
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
