// Checks that need the whole rig: an inverted transform shows in the second camera's pose relative to the
// first.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {
namespace {

constexpr double kMaxShiftDifference_s = 0.5e-3;
constexpr double kMaxReadoutDifference_s = 0.1e-3;  // at 5 rad/s and 450 px, 0.1 px
constexpr double kMaxAxisAngle = 30.0 * std::numbers::pi / 180.0;
constexpr double kMinBaseline = 1e-3;  // m
constexpr double kMaxBaseline = 1;     // m; wider than a drone; centimetres read as metres give about 7

bool xIsLargest(const Eigen::Vector3d& t) {
  return std::abs(t.x()) > std::abs(t.y()) && std::abs(t.x()) > std::abs(t.z());
}

void checkPair(const std::vector<CameraEntry>& cameras, const CalibrationOptions& options,
               Warnings& warnings) {
  const SE3 T_c1_c0 = cameras[1].T_body_cam.inverse() * cameras[0].T_body_cam;
  const SE3 T_c1_c0_reversed = cameras[1].T_body_cam * cameras[0].T_body_cam.inverse();
  const Eigen::Vector3d& t = T_c1_c0.translation;
  const Eigen::Vector3d& reversed = T_c1_c0_reversed.translation;
  const std::string place = fmt::format("cam0 at ({:.4f}, {:.4f}, {:.4f}) m in cam1", t.x(), t.y(), t.z());
  const CameraEntry& second = cameras[1];
  if (t.norm() < kMinBaseline) {
    throw InputError(second.file, second.line, second.field, "both cameras have the same position",
                     "Give each camera its own transform");
  }
  if (t.norm() > kMaxBaseline && !options.accept_unusual_rig) {
    throw InputError(second.file, second.line, second.field, fmt::format("a baseline of {:.3g} m", t.norm()),
                     "Translations are in metres: is this in millimetres, centimetres (OAK) or board squares "
                     "(OpenCV)? A baseline above 1 m needs calibration.accept_unusual_rig");
  }
  if (!xIsLargest(t) && xIsLargest(reversed) && reversed.x() < 0 && !options.accept_unusual_rig) {
    throw InputError(
        second.file, second.line, second.field,
        "looks like an inverted transform: as written, " + place + "; inverted, the cameras are side by side",
        "EuRoC T_BS maps camera to body, Kalibr T_cam_imu maps IMU to camera: invert both matrices, or set "
        "calibration.accept_unusual_rig");
  }
  const std::string where = fmt::format("{}:{}: {}", second.file, second.line, second.field);
  if (!xIsLargest(t)) {
    warnings.push_back(where + ": the cameras are not side by side (" + place + ")");
  } else if (t.x() > 0) {
    warnings.push_back(where + ": cam1 is to the left of cam0 (" + place +
                       "): swapped cameras, or an inverted transform?");
  }
  const double angle = std::acos(std::clamp(T_c1_c0.R()(2, 2), -1.0, 1.0));
  if (angle > kMaxAxisAngle) {
    warnings.push_back(
        where + fmt::format(": the optical axes are {:.0f} degrees apart", angle * 180.0 / std::numbers::pi));
  }
}

void joinShifts(const std::vector<CameraEntry>& cameras, Calibration& calibration) {
  double sum = 0;
  int count = 0;
  for (const CameraEntry& camera : cameras) {
    if (!camera.shift_s) continue;
    sum += *camera.shift_s;
    ++count;
  }
  if (count > 0) calibration.rig.camera_to_imu_shift = Duration::fromSeconds(sum / count);
  if (count == 2 && std::abs(*cameras[0].shift_s - *cameras[1].shift_s) > kMaxShiftDifference_s) {
    calibration.warnings.push_back(
        fmt::format("{}: timeshift_cam_imu of the cameras differs by {:.3f} ms; the mean is used. Check that "
                    "they are triggered together",
                    cameras[1].file, 1e3 * std::abs(*cameras[0].shift_s - *cameras[1].shift_s)));
  }
}

// Refuses different readouts: rows of both cameras must be read at the same time to see the same part of a
// scene.
void joinReadouts(const std::vector<CameraEntry>& cameras, Rig& rig) {
  rig.readout = Duration::fromSeconds(cameras[0].readout_s);
  if (rig.camera_count < 2) return;
  const double difference = std::abs(cameras[0].readout_s - cameras[1].readout_s);
  if (difference <= kMaxReadoutDifference_s) return;
  throw InputError(cameras[1].file, 0, "readout_ms",
                   fmt::format("{:g} ms, but {:g} ms for camera 0", 1e3 * cameras[1].readout_s,
                               1e3 * cameras[0].readout_s),
                   "Use the same shutter and readout_ms for both cameras");
}

}  // namespace

void assembleRig(const std::vector<CameraEntry>& cameras, const CalibrationOptions& options,
                 Calibration& calibration) {
  if (cameras.empty()) throw InputError("calibration", 0, "", "no camera", "Give at least cam0");
  Rig& rig = calibration.rig;
  rig.camera_count = std::min(cameras.size(), kMaxCameras);
  for (std::size_t i = 0; i < rig.camera_count; ++i) {
    rig.camera[i] = cameras[i].lens.model;
    calibration.conversion[i] = cameras[i].lens.words;
    rig.T_body_cam[i] = calibration.T_body_filebody * cameras[i].T_body_cam;
    calibration.camera_rate_hz[i] = cameras[i].rate_hz;
    calibration.camera_topic[i] = cameras[i].topic;
  }
  joinShifts(cameras, calibration);
  joinReadouts(cameras, rig);
  if (rig.camera_count == 2) checkPair(cameras, options, calibration.warnings);
}

}  // namespace swiftlet
