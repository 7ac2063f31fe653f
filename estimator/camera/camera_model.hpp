#pragma once
// One camera: pinhole with radial-tangential distortion, or Kannala-Brandt equidistant.
//
// Frames: the camera looks along +z, x right, y down; pixel (0,0) is the centre of the top-left pixel. Models
// (u = fx xd + cx, v = fy yd + cy):
//  - radial-tangential (Brown; OpenCV's first four coefficients), valid for z > 0 and inside the radius where
//    the radial polynomial is monotonic; beyond it points fold back into the image.
//  - equidistant (Kannala, Brandt, PAMI 2006): theta_d = theta (1 + k1 theta^2 + ... + k4 theta^8), (xd, yd)
//    = theta_d (x, y) / |(x, y)|; valid up to `maxTheta()`, which may exceed 90 degrees.
// Projection costs about 8 ns; unprojection, by Newton's method in at most 20 steps, about 50 ns.

#include <Eigen/Core>
#include <array>

namespace swiftlet {

enum class CameraKind { kPinholeRadtan, kEquidistant };

using Matrix23d = Eigen::Matrix<double, 2, 3>;

class CameraModel {
 public:
  CameraModel() = default;
  /// intrinsics fx, fy, cx, cy [px]; distortion k1 k2 p1 p2 (radtan) or k1..k4 (equidistant).
  CameraModel(CameraKind kind, int width, int height, const Eigen::Vector4d& intrinsics,
              const Eigen::Vector4d& distortion);

  [[nodiscard]] CameraKind kind() const { return kind_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const Eigen::Vector4d& intrinsics() const { return intrinsics_; }
  [[nodiscard]] const Eigen::Vector4d& distortion() const { return distortion_; }
  /// Mean focal length [px]: pixels per radian near the image centre.
  [[nodiscard]] double focal() const { return 0.5 * (intrinsics_[0] + intrinsics_[1]); }
  /// Largest angle from the optical axis [rad] at which the model can be inverted.
  [[nodiscard]] double maxTheta() const { return max_theta_; }

  /// Projects a point in the camera frame [m] to a pixel, which may be outside the image. False outside the
  /// model's valid range (behind a pinhole, beyond the fold, NaN). `jacobian`, if given, is d pixel / d
  /// point.
  [[nodiscard]] bool project(const Eigen::Vector3d& p_cam, Eigen::Vector2d& pixel,
                             Matrix23d* jacobian = nullptr) const;

  /// Pixel to unit bearing in the camera frame. False if the model has no inverse there.
  [[nodiscard]] bool unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d& bearing) const;

  /// Whether the pixel is at least `border` pixels inside the image.
  [[nodiscard]] bool inImage(const Eigen::Vector2d& pixel, double border = 0) const {
    return pixel.x() >= border && pixel.y() >= border && pixel.x() <= width_ - 1 - border &&
           pixel.y() <= height_ - 1 - border;
  }

 private:
  CameraKind kind_ = CameraKind::kPinholeRadtan;
  int width_ = 0;
  int height_ = 0;
  Eigen::Vector4d intrinsics_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d distortion_ = Eigen::Vector4d::Zero();
  double max_theta_ = 0;
};

}  // namespace swiftlet
