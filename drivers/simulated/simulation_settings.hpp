#pragma once
// Settings of a simulated flight. The defaults give a minute in a furnished room with EuRoC's rig and IMU.
// The same settings give the same bytes with any number of threads.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/simulated/camera_renderer.hpp"
#include "drivers/simulated/flight_path.hpp"
#include "drivers/simulated/image_sensor.hpp"
#include "drivers/simulated/imu_simulator.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "drivers/simulated/simulated_exposure.hpp"
#include "drivers/simulated/textured_world.hpp"
#include "drivers/simulated/track_simulator.hpp"
#include "drivers/simulated/world.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FaultKind : std::uint8_t {
  kBlackout,       ///< images arrive, but dark
  kCameraMissing,  ///< images are missing
  kImuGap,         ///< no IMU samples
  kImuSaturation,  ///< the IMU clips at imu.low_gyro_limit and imu.low_accel_limit
};

struct Fault {
  FaultKind kind = FaultKind::kBlackout;
  TimeSpan span;    ///< s since the start of the log
  int camera = -1;  ///< for blackout and missing camera; -1: all
};

enum class ImageFormat : std::uint8_t { kPng, kJpeg };

struct SimulationSettings {
  std::uint64_t seed = 1;        ///< for everything random; overwrites the seeds in the parts below
  std::uint64_t world_seed = 0;  ///< fixes the world while the flight changes; 0: as `seed`

  WorldSettings world;    ///< kind, clutter, size
  FlightSettings flight;  ///< duration, speed, aggressiveness, rests; its R_flu_body comes from the rig
  /// EuRoC ground truth to fly instead of a generated path (given_motion.hpp), for flight.duration at most.
  std::string given_motion;
  /// Motions that the world is fitted to and kept clear for, instead of the flight's own: flights with the
  /// same list and world_seed have the same world.
  std::vector<std::string> world_for;
  double motion_skip = 0;  ///< s omitted at its beginning

  /// A random rig has its own noise, IMU matrices, time offset and readout instead of those below.
  RigKind rig = RigKind::kEuroc;
  std::uint64_t rig_seed = 1;  ///< of a random rig
  bool mono = false;           ///< camera 0 only
  double camera_rate = 20;     ///< Hz
  double first_image = 0.1;    ///< s of IMU data before the first image

  ImuSimulationSettings imu;  ///< noise, biases, vibration; its gaps and saturations come from `faults`
  PaintSettings paint;
  RenderSettings render;  ///< samples, exposure time
  SensorSettings sensor;  ///< light, noise, vignette, gain control
  ExposureMode exposure_mode = ExposureMode::kGain;
  std::vector<LightChange> light_changes;  ///< sorted by start
  bool low_light = false;                  ///< a dim room: 5 % of the light, 10 ms exposure
  TrackSettings tracks;                    ///< for feature tracks instead of images

  ImageFormat format = ImageFormat::kJpeg;
  int jpeg_quality = 92;
  int depth_every = 5;                     ///< depth and labels at every n-th frame; 0: none
  Stamp start{1'700'000'000'000'000'000};  ///< stamp of the trajectory's time zero

  std::vector<Fault> faults;
  /// Added to the image stamps in the log: the estimator must find t_imu = t_image - image_stamp_offset.
  Duration image_stamp_offset;
  /// Errors of the calibration that is given to the estimator: a rotation vector [deg, body axes] of the
  /// whole rig about camera 0's centre, and one of each camera about its own centre.
  Eigen::Vector3d rig_turn_deg = Eigen::Vector3d::Zero();
  std::array<Eigen::Vector3d, kMaxCameras> camera_turn_deg{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};

  int threads = 2;
};

}  // namespace swiftlet
