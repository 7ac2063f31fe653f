#pragma once
// Fields that EuRoC and Kalibr files share: rigid transforms, lenses, noise densities; and the entry that a
// reader makes for one camera. Private to this folder.

#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/calibration/lens_fit.hpp"
#include "drivers/calibration/yaml_field.hpp"

namespace swiftlet {

struct CameraEntry {
  LensFit lens;
  SE3 T_body_cam;
  double rate_hz = 0;
  std::optional<double> shift_s;  ///< t_imu = t_cam + shift
  double readout_s = 0;           ///< of a rolling shutter; 0: global shutter
  std::string topic;
  std::string file;  ///< file of the extrinsics, for the checks across cameras
  int line = 0;
  std::string field;
};

/// The numbers of a list, of a list of rows, or of {rows, cols, data}.
std::vector<double> readNumbers(const YamlField& field);
/// The same, row by row, for a matrix that must have this size.
std::vector<double> readMatrix(const YamlField& field, std::size_t rows, std::size_t columns);

/// fx, fy, cx, cy of a camera matrix; rejects a skew and other matrices.
Eigen::Vector4d readIntrinsics(const InputPlace& place, const Eigen::Matrix3d& K);

/// A 4x4 rigid transform, written as four lists of four or as {rows, cols, data}. Refuses a wrong last row,
/// mirroring, millimetres and matrices further than 1e-3 from orthonormal; above 1e-6 it re-orthonormalises
/// and warns.
SE3 readTransform(const YamlField& field, Warnings& warnings);

/// The checks of readTransform for numbers already read.
SE3 checkedTransform(const InputPlace& place, const Eigen::Matrix3d& R, const Eigen::Vector3d& t,
                     Warnings& warnings);

/// [width, height] in pixels.
std::array<int, 2> readResolution(const YamlField& field);

/// Refuses impossible widths and heights.
void checkResolution(const InputPlace& place, double width, double height);

/// Refuses fx, fy, cx, cy that cannot belong to an image of this size; warns if they are unlikely.
void checkIntrinsics(const InputPlace& place, const Eigen::Vector4d& intrinsics, int width, int height,
                     Warnings& warnings);

/// Coefficients in OpenCV's order: 4, 5, 8, 12 or 14 of them, or none.
void setBrown(const InputPlace& place, const std::vector<double>& values, SourceLens& lens);

/// k1..k4; any other number is refused.
void setEquidistant(const InputPlace& place, const std::vector<double>& values, SourceLens& lens);

/// Checks the intrinsics and converts the lens; warns about a pinhole without an inverse in an image corner.
LensFit acceptLens(const InputPlace& place, const SourceLens& lens, Warnings& warnings);

/// Lens in EuRoC and Kalibr files. InputError names a model that is not supported.
LensFit readLens(const YamlField& camera, const std::string& coefficients_key, Warnings& warnings);

/// `timeshift_cam_imu` of a camera [s]; empty if not given. Rejects more than a second.
std::optional<double> readShift(const YamlField& camera, Warnings& warnings);

/// The same check on a number of seconds.
double checkedShift(const InputPlace& place, double shift_s, Warnings& warnings);

/// Scale and misalignment of an IMU file in Kalibr's or OpenVINS' form; rejects models that are not
/// supported.
void readImuModel(const YamlField& imu, Calibration& calibration);

/// `readout_ms` of a camera with `shutter: rolling` [s]; 0 for a global shutter, which is the default.
double readReadout(const YamlField& camera);

/// The four densities and the rate under the names of EuRoC and Kalibr. If `left_out` is given, random walks
/// are optional: a missing key is added to it and ImuNoise's value is kept.
ImuNoise readNoise(const YamlField& imu, const std::string& rate_key, Warnings& warnings,
                   std::vector<std::string>* left_out = nullptr);

/// Joins the cameras to a rig after the checks that need all of them.
void assembleRig(const std::vector<CameraEntry>& cameras, const CalibrationOptions& options,
                 Calibration& calibration);

}  // namespace swiftlet
