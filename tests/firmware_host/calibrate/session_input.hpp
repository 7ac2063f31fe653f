#pragma once
// Views of a simulated session as calibrateCameras takes them. Global shutter: a rolling one is imu_camera's.

#include <cstdint>
#include <utility>

#include "drivers/simulated/calibration_rig.hpp"
#include "drivers/simulated/calibration_session.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"

namespace swiftlet::test {

/// Pinholes for even seeds, Kannala-Brandt for odd ones.
inline CalibrationRig globalShutterRig(std::uint64_t seed) {
  CalibrationRig rig =
      drawCalibrationRig(seed, seed % 2 == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant);
  rig.rig.readout = {};
  return rig;
}

inline CameraInput sessionInput(const CalibrationRig& rig, const CalibrationTarget& target,
                                const SessionSettings& settings) {
  const CalibrationSession session(rig, target, settings);
  CameraInput input;
  input.target = target;
  input.camera_count = 2;
  for (std::size_t c = 0; c < 2; ++c) {
    input.image_size[c] = {rig.rig.camera[c].width(), rig.rig.camera[c].height()};
  }
  for (int k = 0; k < session.imageCount(); ++k) {
    for (BoardView& view : session.views(k)) input.views.push_back(std::move(view));
  }
  return input;
}

}  // namespace swiftlet::test
