// EuRoC/ASL sensor.yaml: camera and IMU.

#include <fmt/format.h>

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {
namespace {

CameraEntry readCamera(const YamlField& root, Warnings& warnings) {
  CameraEntry entry;
  const YamlField T_BS = root.at("T_BS", "Give the transform from camera to body");
  entry.T_body_cam = readTransform(T_BS, warnings);
  entry.lens = readLens(root, "distortion_coefficients", warnings);
  if (root.has("rate_hz")) entry.rate_hz = root.at("rate_hz").number();
  entry.shift_s = readShift(root, warnings);
  entry.readout_s = readReadout(root);
  entry.file = T_BS.file();
  entry.line = T_BS.line();
  entry.field = T_BS.name();
  return entry;
}

void readImu(const YamlField& root, Calibration& calibration) {
  if (root.has("camera_model")) {
    throw root.error("this describes a camera, not an IMU", "Give imu0/sensor.yaml");
  }
  calibration.noise = readNoise(root, "rate_hz", calibration.warnings);
  readImuModel(root, calibration);
  if (!root.has("T_BS")) return;
  const YamlField field = root.at("T_BS");
  const SE3 T_body_imu = readTransform(field, calibration.warnings);
  const Eigen::Matrix3d R = T_body_imu.R();
  if (!R.isIdentity(1e-9)) {
    calibration.R_body_imu = R;
    calibration.warnings.push_back(field.where() +
                                   ": the IMU is rotated in the body; its samples are rotated to body axes");
  }
  calibration.T_body_filebody.translation = -T_body_imu.translation;
  if (T_body_imu.translation.norm() > 0) {
    calibration.warnings.push_back(
        field.where() +
        fmt::format(": the IMU is {:.4f} m from the body's origin; the trajectory is the IMU's, in body axes",
                    T_body_imu.translation.norm()));
  }
}

}  // namespace

Calibration parseEurocCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                  const CalibrationOptions& options) {
  Calibration calibration;
  calibration.form = "EuRoC";
  std::vector<CameraEntry> entries;
  for (const NamedText& camera : cameras) {
    entries.push_back(readCamera(YamlField::parse(camera.name, camera.text), calibration.warnings));
  }
  readImu(YamlField::parse(imu.name, imu.text), calibration);
  assembleRig(entries, options, calibration);
  return calibration;
}

}  // namespace swiftlet
