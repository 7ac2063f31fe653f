#pragma once
// Findings from comparing gyro, accelerometer and camera: clock, unit, axes, focal length, gravity.

#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"
#include "firmware_host/inspection/finding.hpp"

namespace swiftlet {

/// `even`: stamps of `images` on an even clock. Measured values are added to `measured`.
std::vector<Finding> motionFindings(const Calibration& calibration, const std::vector<ImuSample>& samples,
                                    const std::vector<TrackedImage>& images, const std::vector<Stamp>& even,
                                    std::vector<Measured>& measured);

}  // namespace swiftlet
