#pragma once
// Converts ROS's sensor_msgs/CameraInfo, from a topic or a file, to the estimator's lens models and to the
// transform between two cameras.
//
// A stream carries either raw images, described by K and D, or rectified images (`image_rect`), described by
// P without distortion. R rotates a point from the raw camera's frame to the rectified one. P(0,3) of the
// second camera of a pair is -fx times the baseline [px m].
//
// Errors: InputError that names `name`, the field and the remedy. Suspicious values and inexact conversions
// add a line to the warnings. Host side only: allocates; a conversion takes some tens of ms.

#include <array>
#include <string>
#include <vector>

#include "drivers/calibration/lens_fit.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// The message without header, binning and region of interest: width and height are those of K.
struct CameraInfo {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  std::string distortion_model;
  std::vector<double> D;
  std::array<double, 9> K{};   ///< row by row [px]
  std::array<double, 9> R{};   ///< row by row
  std::array<double, 12> P{};  ///< row by row [px], last column [px m]
};

/// Lens of the raw images and the error of its conversion. `name`: the file or topic, for messages.
[[nodiscard]] LensFit rawLensFit(const CameraInfo& info, const std::string& name, Warnings& warnings);

/// Only the lens; if the conversion is not exact, a warning states its error.
[[nodiscard]] CameraModel rawLens(const CameraInfo& info, const std::string& name, Warnings& warnings);

/// Lens of the rectified images: P, no distortion.
[[nodiscard]] CameraModel rectifiedLens(const CameraInfo& info, const std::string& name, Warnings& warnings);

/// T_cam1_cam0 of a stereo pair's raw or rectified images. The left camera is the one with P(0,3) = 0.
/// `name`: the right camera's file or topic.
[[nodiscard]] SE3 rawPair(const CameraInfo& left, const CameraInfo& right, const std::string& name);
[[nodiscard]] SE3 rectifiedPair(const CameraInfo& right, const std::string& name);

}  // namespace swiftlet
