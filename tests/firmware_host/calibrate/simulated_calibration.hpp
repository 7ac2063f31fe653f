#pragma once
// One simulated rig through the batch, beside its truth.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/simulated/calibration_session.hpp"
#include "firmware_host/lab/calibrate/imu_camera/calibrate_imu_camera.hpp"

namespace swiftlet {

/// Corners and readings of the session; the lenses as a camera step with errors of its own would start them.
ImuCameraInput batchInput(const CalibrationSession& session);

struct ValueError {
  std::string name;
  std::string unit;
  double error = 0;  ///< found - true, in `unit`
  double sigma = 0;
};

struct CalibrationErrors {
  std::vector<ValueError> values;
  double nees = 0;  ///< squared error in the solution's covariance
  [[nodiscard]] double worst(const std::string& unit, const std::string& part = {}) const;
};
CalibrationErrors errorsOf(const ImuCameraSolution& solution, const CalibrationSession& session);

}  // namespace swiftlet
