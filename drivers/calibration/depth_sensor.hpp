#pragma once
// Reads the sensor.yaml of a depth camera: an ideal pinhole camera, its pose, and the unit of its images.
// Host side only: allocates and throws InputError with file, line and field.

#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

struct DepthSensor {
  PinholeIntrinsics camera;
  SE3 T_body_camera;              ///< body as in the file
  double metres_per_unit = 1e-3;  ///< `depth_unit_m`; millimetres by default
};

/// Refuses a lens with distortion: depth along the axis is ambiguous in a distorted image.
DepthSensor readDepthSensor(const NamedText& file, std::vector<std::string>& warnings);

}  // namespace swiftlet
