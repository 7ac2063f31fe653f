#pragma once
// Lenses in the conventions of other tools: every model found in calibration files, with its projection.
// drivers/calibration/lens_fit.hpp converts them to the estimator's two models.
//
// With a = x/z, b = y/z, r^2 = a^2 + b^2 of a point (x, y, z) in the camera's frame, d its distance:
//  - Brown (OpenCV; ROS plumb_bob and rational_polynomial; Basalt pinhole-radtan8): k1 k2 p1 p2 k3 k4 k5 k6
//    s1 s2 s3 s4 tau_x tau_y. Radial factor (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6),
//    tangential terms, thin prism, then a tilted sensor.
//  - equidistant (Kannala-Brandt; OpenCV's fisheye): k1..k4.
//  - omni (Mei): a = x / (z + xi d), b = y / (z + xi d), then Brown's k1 k2 p1 p2.
//  - double sphere: d2^2 = x^2 + y^2 + (xi d + z)^2; a = x / (alpha d2 + (1 - alpha)(xi d + z)).
//  - extended unified: d2^2 = beta (x^2 + y^2) + z^2; a = x / (alpha d2 + (1 - alpha) z).
//  - field of view (Devernay, Faugeras): r_d = atan(2 r tan(w/2)) / w.
// Then u = fx a + cx, v = fy b + cy. Sources: the manuals of OpenCV, Kalibr and Basalt; Usenko, Demmel,
// Cremers, "The Double Sphere Camera Model", 3DV 2018.

#include <Eigen/Core>
#include <array>
#include <string>

namespace swiftlet {

enum class LensFamily { kBrown, kEquidistant, kOmni, kDoubleSphere, kExtendedUnified, kFieldOfView };

struct SourceLens {
  LensFamily family = LensFamily::kBrown;
  std::string name;                                      ///< as in the file, for messages
  int width = 0;                                         ///< [px]
  int height = 0;                                        ///< [px]
  Eigen::Vector4d intrinsics = Eigen::Vector4d::Zero();  ///< fx fy cx cy [px]
  /// omni: xi; double sphere: xi, alpha; extended unified: alpha, beta; field of view: w [rad].
  std::array<double, 2> shape{};
  std::array<double, 14> distortion{};  ///< in the order above; zero if the model has fewer
  double max_radius = 0;                ///< Brown: largest r that was calibrated; 0: not known

  /// Projects a point in the camera's frame to a pixel. False if the formula has no value: behind a pinhole,
  /// or with a zero denominator. Points beyond a fold also get a pixel; lens_fit.hpp finds the valid region.
  [[nodiscard]] bool project(const Eigen::Vector3d& p_cam, Eigen::Vector2d& pixel) const;
};

}  // namespace swiftlet
