#pragma once
// Estimates the calibration from a piece of a flight: bundle adjustment of some keyframes with the
// calibration as a variable.
//
// Variables: poses, velocities and biases of the keyframes, inverse depths and directions of the points, and
// the calibration's change (CalibrationChange). Factors: sightings (pixels, Cauchy), preintegrated samples,
// random walks of the biases. Points are eliminated, then states; what remains is the information on the
// calibration. Priors of the calibration keep a single piece solvable; they are subtracted from its
// information afterwards, so that pieces can be added. Off the flight path. Cost: some 0.1 s per keyframe.
// Memory: 8 (15 keyframes + 26)^2 bytes.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

/// Columns of the calibration's change. Rotations on the right, R <- R Exp(phi); the rest is added.
namespace change {
inline constexpr int kShift = 0;     ///< s, added to camera_to_imu_shift
inline constexpr int kTurn = 1;      ///< rad, of T_body_cam0
inline constexpr int kMove = 4;      ///< m, of T_body_cam0
inline constexpr int kFocal = 7;     ///< per camera: relative change of fx and fy together
inline constexpr int kRigTurn = 9;   ///< rad, of T_cam0_cam1
inline constexpr int kRigMove = 12;  ///< m, of T_cam0_cam1
inline constexpr int kGyro = 15;     ///< matrix by columns: reading = (I + M) rate + bias
inline constexpr int kAccel = 24;    ///< scale per axis: reading = (1 + s) force + bias
inline constexpr int kCount = 27;
}  // namespace change
using CalibrationChange = Eigen::Matrix<double, change::kCount, 1>;
using ChangeMatrix = Eigen::Matrix<double, change::kCount, change::kCount>;

/// Prior standard deviation of each column: the largest calibration errors that the check must detect.
CalibrationChange changePriors();

/// A keyframe of a flight, as in keyframes.swk.
struct FlightKeyframe {
  TrackedFrame frame;
  NavState state;
  NoiseInUse noise;
  std::vector<ImuSample> samples;  ///< from the previous keyframe to slightly beyond this one
};

/// Residual of a sighting.
struct SightingResidual {
  Stamp stamp;
  std::size_t camera = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  ///< px, seen - predicted
  bool outlier = false;
};

struct PieceResult {
  bool solved = false;
  Stamp begin;
  Stamp end;
  CalibrationChange change = CalibrationChange::Zero();
  ChangeMatrix information = ChangeMatrix::Zero();  ///< without the priors
  double rms = 0;                                   ///< px per axis, without outliers
  std::size_t sightings = 0;
  std::size_t stereo_points = 0;
  std::size_t points = 0;
  std::vector<SightingResidual> residuals;
};

/// Sightings to use, by their distance from the lens's centre: kInner is half of the image's area.
enum class ImagePart : std::uint8_t { kAll, kInner, kOuter };

/// `rig`: as in the file. `noise`: as in flight.
PieceResult solvePiece(const Rig& rig, const ImuNoise& noise, const std::vector<FlightKeyframe>& keyframes,
                       ImagePart part = ImagePart::kAll);

}  // namespace swiftlet
