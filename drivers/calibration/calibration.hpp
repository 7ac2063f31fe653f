#pragma once
// Reads calibration files of EuRoC/ASL (`sensor.yaml` of camera and IMU), Kalibr (camchain and IMU YAML),
// Basalt (JSON), ROS (camera_info) and OpenCV (FileStorage) into one Rig and one ImuNoise. The last two
// contain only cameras: a Kalibr IMU file with `T_imu_cam0` completes them.
//
// Directions (docs/formats.md): EuRoC `T_BS` maps sensor to body and is used as is; Kalibr `T_cam_imu` maps
// IMU to camera and is inverted; `T_cn_cnm1` maps camera n-1 to camera n and is chained; `T_imu_cam`
// (OpenVINS) maps camera to IMU. The key decides, never the file's name.
//
// Body: the estimator's body has its origin in the IMU. If the IMU file's `T_BS` is not the identity, the
// body keeps the axes of the file's body frame: samples are rotated by `R_body_imu`, the cameras are moved by
// `T_body_filebody`, and poses of the file's body follow from T_world_filebody = T_world_body *
// T_body_filebody.
//
// Errors: InputError with file, line, field and remedy for everything that cannot be trusted; values that are
// only suspicious go to `warnings`. Host side only: allocates and throws.

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/calibration/imu_correction.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"

namespace swiftlet {

class FileTree;

struct CalibrationOptions {
  /// Accept a rig whose geometry suggests an inverted transform.
  bool accept_unusual_rig = false;
};

struct Calibration {
  std::string form;  ///< "EuRoC", "Kalibr", "Basalt", "ROS CameraInfo" or "OpenCV"
  /// True: not calibrated. Only the number and size of the cameras and the IMU's rate are valid.
  bool bare = false;
  Rig rig;
  ImuNoise noise;  ///< densities as in the file, without inflation
  Eigen::Matrix3d R_body_imu = Eigen::Matrix3d::Identity();
  /// Errors of the sensors, in their own axes (imu_correction.hpp), from `scale-misalignment` IMU files.
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d gyro_by_force = Eigen::Matrix3d::Zero();  ///< rad/s per m/s^2
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  SE3 T_body_filebody;  ///< translation only
  /// How a lens model that the estimator does not have was converted (lens_fit.hpp); empty if unchanged.
  std::array<std::string, kMaxCameras> conversion;
  std::array<double, kMaxCameras> camera_rate_hz{};  ///< 0 if the file does not give it
  /// `rostopic` of the Kalibr files, to find the streams in a bag; empty if not given.
  std::array<std::string, kMaxCameras> camera_topic;
  std::string imu_topic;
  std::vector<std::string> warnings;

  [[nodiscard]] bool turnsImu() const { return !R_body_imu.isIdentity(0); }
  /// Whether the file gives scale and misalignment, which imuCorrection() removes.
  [[nodiscard]] bool hasImuMatrices() const {
    return !gyro_matrix.isIdentity(0) || !gyro_by_force.isZero(0) || !accel_matrix.isIdentity(0);
  }
  /// Correction from readings to samples in body axes.
  [[nodiscard]] ImuCorrection imuCorrection() const {
    return ImuCorrection{gyro_matrix, gyro_by_force, accel_matrix}.inverse().turned(R_body_imu);
  }
  /// For samples that are already in body axes, such as those of a flight recording.
  void forgetImuCorrection() {
    R_body_imu.setIdentity();
    gyro_matrix.setIdentity();
    gyro_by_force.setZero();
    accel_matrix.setIdentity();
  }
};

/// Reads the calibration at `path`: a sequence or its mav0 folder, a folder with the files of one
/// calibration, or one of these files (with the IMU file beside it or given as `imu_file`). The format is
/// detected by content. A single camera_info or OpenCV file gives only its own content; its folder gives the
/// pair.
Calibration readCalibration(const std::string& path, const std::string& imu_file = {},
                            const CalibrationOptions& options = {});

/// The same from a folder of a tree, "" for its root; `imu_file`, if given, is on disk.
Calibration readCalibration(FileTree& tree, const std::string& folder, const std::string& imu_file = {},
                            const CalibrationOptions& options = {});

/// Cameras of a Kalibr camchain. Without an IMU, camera 0 is the body.
struct CameraChain {
  Rig rig;
  bool has_imu = false;
};
CameraChain readCameraChain(const std::string& file);

/// Noise and rate of an IMU file of Kalibr or EuRoC. If the file lacks a random walk, for instance because
/// the log at rest was too short, ImuNoise's typical value is kept and the key is added to `left_out`.
ImuNoise readImuNoise(const std::string& file, std::vector<std::string>& left_out);

/// Whether the folder or file `path` has a calibration that readCalibration() would find, valid or not.
bool hasCalibration(const std::string& path);
bool hasCalibration(FileTree& tree, const std::string& folder);

/// The same from text in memory (EuRoC: one text per camera), for tests and embedded rigs. `name` names the
/// file in messages.
struct NamedText {
  std::string name;
  std::string_view text;
};
Calibration parseEurocCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                  const CalibrationOptions& options = {});
Calibration parseKalibrCalibration(const NamedText& camchain, const NamedText& imu,
                                   const CalibrationOptions& options = {});

/// One camera_info per camera; `imu`: noise and T_imu_cam0.
Calibration parseCameraInfoCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                       const CalibrationOptions& options = {});
/// The files of one calibration, such as intrinsics.yml and extrinsics.yml.
Calibration parseOpenCvCalibration(const std::vector<NamedText>& files, const NamedText& imu,
                                   const CalibrationOptions& options = {});
Calibration parseBasaltCalibration(const NamedText& file, const CalibrationOptions& options = {});

/// The rig as text, one line per fact: position and direction of each camera, the baseline, the lenses, the
/// noise per sample. For comparison with the hardware.
std::string describe(const Calibration& calibration);

}  // namespace swiftlet
