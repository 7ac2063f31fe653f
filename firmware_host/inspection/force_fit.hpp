#pragma once
// Compares the accelerometer with the camera: do the images show the accelerations that it measures?
//
// In a window of about a second, with rotations from the gyro, the camera moves by v t + g t^2 / 2 + s A(t):
// A is the accelerometer integrated twice, g gravity, s the scale of the scene, negative if the accelerometer
// is negated. With points tracked through the window this is a linear problem (as in the closed-form
// initialization of Martinelli, IJCV 2014, but free of scale): v, g and s minimize the mean square of the
// points' angular errors. |g| / |s| is gravity as seen by images and accelerometer.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"

namespace swiftlet {

struct ForceFit {
  std::size_t windows = 0;     ///< windows that determine v, g and s
  std::size_t negative = 0;    ///< of these, with s < 0
  double gravity = 0;          ///< median of |g| / |s| [m/s^2]
  double error = 0;            ///< px, geometric mean over the windows of the points' rms error
  std::vector<double> errors;  ///< px, of each window

  /// Whether nearly every window has a smaller error than in the other fit.
  [[nodiscard]] bool beats(const ForceFit& other) const;
};

class ForceFitter {
 public:
  /// `gyro_offset` [rad/s] is subtracted from the rates. Cost: about 1 ms per second of images.
  ForceFitter(const std::vector<TrackedImage>& images, const std::vector<ImuSample>& samples,
              const CameraModel& camera, const SE3& T_body_cam, Duration shift,
              const Eigen::Vector3d& gyro_offset);

  /// Fits with `axes` applied to the accelerometer's readings. Cost: 10 us per window.
  [[nodiscard]] ForceFit fit(const Eigen::Matrix3d& axes) const;

 private:
  // v, g, the nine integrals of each reading along each axis, and the camera's lever arm.
  static constexpr int kColumns = 16;
  using Place = Eigen::Matrix<double, 3, kColumns>;
  using Square = Eigen::Matrix<double, kColumns, kColumns>;

  struct Window {
    Square error = Square::Zero();
    Square depth = Square::Zero();
    Eigen::Matrix<double, kColumns, 1> towards = Eigen::Matrix<double, kColumns, 1>::Zero();
  };
  struct BodyAt {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Place place = Place::Zero();
  };

  [[nodiscard]] static std::vector<BodyAt> integrate(const std::vector<ImuSample>& samples,
                                                     const std::vector<Stamp>& wanted,
                                                     const Eigen::Vector3d& offset,
                                                     const Eigen::Vector3d& lever);
  void addWindow(const std::vector<const TrackedImage*>& images, const std::vector<BodyAt>& bodies,
                 const CameraModel& camera, const Eigen::Matrix3d& R_body_cam);

  double focal_ = 1;
  std::vector<Window> windows_;
};

}  // namespace swiftlet
