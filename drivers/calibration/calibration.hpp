#pragma once
// Calibration files as users have them: EuRoC/ASL `sensor.yaml` (camera and IMU), Kalibr camchain and IMU
// YAML, Basalt's JSON, ROS camera_info and OpenCV's FileStorage, all turned into one Rig and one ImuNoise.
// The last two hold cameras alone: an IMU file as Kalibr's, with `T_imu_cam0`, completes them.
//
// Directions (docs/formats.md): EuRoC `T_BS` maps sensor to body and is used as is; Kalibr
// `T_cam_imu` maps IMU to camera and is inverted; `T_cn_cnm1` maps camera n-1 to camera n and chains;
// `T_imu_cam` (OpenVINS) maps camera to IMU. The key decides, never the file's name.
//
// Body: the estimator's body has its origin in the IMU. Where the IMU file's `T_BS` is not the
// identity, the body keeps the axes of the file's body frame: samples are turned by `R_body_imu`, the
// cameras are moved by `T_body_filebody`, and poses of the file's body follow from
// T_world_filebody = T_world_body * T_body_filebody.
//
// Errors: InputError with file, line, field and remedy for everything that cannot be trusted; what is
// only suspicious goes to `warnings`. Host side only: allocates and throws.

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
  /// A rig before its calibration: number and size of the cameras and the IMU's rate are right, nothing else.
  bool bare = false;
  Rig rig;
  ImuNoise noise;  ///< densities as in the file, not inflated
  Eigen::Matrix3d R_body_imu = Eigen::Matrix3d::Identity();
  /// Of the sensors, in their own axes (imu_correction.hpp). `scale-misalignment` IMU files have them.
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d gyro_by_force = Eigen::Matrix3d::Zero();  ///< rad/s per m/s^2
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  SE3 T_body_filebody;  ///< translation only
  /// How a lens that the estimator does not have was converted (lens_fit.hpp); empty if it is as in the
  /// file.
  std::array<std::string, kMaxCameras> conversion;
  std::array<double, kMaxCameras> camera_rate_hz{};  ///< 0 if the file does not give it
  /// `rostopic` of the Kalibr files, to find the streams in a bag; empty if not given.
  std::array<std::string, kMaxCameras> camera_topic;
  std::string imu_topic;
  std::vector<std::string> warnings;

  [[nodiscard]] bool turnsImu() const { return !R_body_imu.isIdentity(0); }
  /// The sensors' errors are given and taken out.
  [[nodiscard]] bool hasImuMatrices() const {
    return !gyro_matrix.isIdentity(0) || !gyro_by_force.isZero(0) || !accel_matrix.isIdentity(0);
  }
  /// From readings to samples in body axes.
  [[nodiscard]] ImuCorrection imuCorrection() const {
    return ImuCorrection{gyro_matrix, gyro_by_force, accel_matrix}.inverse().turned(R_body_imu);
  }
  /// For samples that are in body axes already, such as a flight recording's.
  void forgetImuCorrection() {
    R_body_imu.setIdentity();
    gyro_matrix.setIdentity();
    gyro_by_force.setZero();
    accel_matrix.setIdentity();
  }
};

/// Reads the calibration at `path`: a sequence or its mav0 folder, a folder with the files of one
/// calibration, or one of these files (its IMU file beside it, or given as `imu_file`). The format is
/// detected by content. A camera_info or OpenCV file gives only its own content; its folder gives the pair.
Calibration readCalibration(const std::string& path, const std::string& imu_file = {},
                            const CalibrationOptions& options = {});

/// The same in a tree's folder, "" its root; a given `imu_file` is on disk.
Calibration readCalibration(FileTree& tree, const std::string& folder, const std::string& imu_file = {},
                            const CalibrationOptions& options = {});

/// Cameras of a Kalibr camchain; without an IMU the body is camera 0.
struct CameraChain {
  Rig rig;
  bool has_imu = false;
};
CameraChain readCameraChain(const std::string& file);

/// Noise and rate of an IMU file, Kalibr's or EuRoC's. A random walk that the file does not have, since its
/// log at rest was short, keeps ImuNoise's typical value; `left_out` gets its key.
ImuNoise readImuNoise(const std::string& file, std::vector<std::string>& left_out);

/// True when the folder or file `path` has a calibration that readCalibration would find (good or bad).
bool hasCalibration(const std::string& path);
bool hasCalibration(FileTree& tree, const std::string& folder);

/// The same from text in memory (EuRoC: one text per camera), for tests and embedded rigs. `name`s name the
/// files in messages.
struct NamedText {
  std::string name;
  std::string_view text;
};
Calibration parseEurocCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                  const CalibrationOptions& options = {});
Calibration parseKalibrCalibration(const NamedText& camchain, const NamedText& imu,
                                   const CalibrationOptions& options = {});

/// One camera_info a camera; `imu`: noise and T_imu_cam0.
Calibration parseCameraInfoCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                       const CalibrationOptions& options = {});
/// The files of one calibration, such as intrinsics.yml and extrinsics.yml.
Calibration parseOpenCvCalibration(const std::vector<NamedText>& files, const NamedText& imu,
                                   const CalibrationOptions& options = {});
Calibration parseBasaltCalibration(const NamedText& file, const CalibrationOptions& options = {});

/// The rig in words, a line per fact: where each camera sits and looks, the baseline, the lenses, the
/// noise per sample. Meant to be compared with the hardware on the table.
std::string describe(const Calibration& calibration);

}  // namespace swiftlet
