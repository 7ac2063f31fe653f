#pragma once
// Everything that can be asked of a simulated flight. The defaults give a minute in a furnished
// room with EuRoC's rig and IMU. The same settings give the same bytes, on any number of threads.

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
  int camera = -1;  ///< of blackout and missing camera; -1: all
};

enum class ImageFormat : std::uint8_t { kPng, kJpeg };

struct SimulationSettings {
  std::uint64_t seed = 1;        ///< of everything random; overwrites the seeds in the parts below
  std::uint64_t world_seed = 0;  ///< keeps the world while the flight changes; 0: as `seed`

  WorldSettings world;    ///< kind, clutter, size
  FlightSettings flight;  ///< duration, speed, aggressiveness, rests; its R_flu_body comes from the rig
  /// EuRoC ground truth to fly in place of an own path (given_motion.hpp); flight.duration cuts it.
  std::string given_motion;
  /// Motions that the world is fitted to and kept clear for, in place of the flight's own: flights with the
  /// same list and world_seed are in the same world.
  std::vector<std::string> world_for;
  double motion_skip = 0;  ///< s of it left out at the beginning

  /// A random rig has its own noise, IMU matrices, time offset and readout instead of those below.
  RigKind rig = RigKind::kEuroc;
  std::uint64_t rig_seed = 1;  ///< of a random rig
  bool mono = false;           ///< camera 0 alone
  double camera_rate = 20;     ///< Hz
  double first_image = 0.1;    ///< s of IMU before the first image

  ImuSimulationSettings imu;  ///< noise, biases, vibration; its gaps and saturations come from `faults`
  PaintSettings paint;
  RenderSettings render;  ///< samples, exposure time
  SensorSettings sensor;  ///< light, noise, vignette, control of the gain
  ExposureMode exposure_mode = ExposureMode::kGain;
  std::vector<LightChange> light_changes;  ///< in order of their start
  bool low_light = false;                  ///< a dim room: 5 % of the light, 10 ms exposure
  TrackSettings tracks;                    ///< where feature tracks take the images' place

  ImageFormat format = ImageFormat::kJpeg;
  int jpeg_quality = 92;
  int depth_every = 5;                     ///< depth and labels at every n-th frame; 0: none
  Stamp start{1'700'000'000'000'000'000};  ///< stamp of the trajectory's time zero

  std::vector<Fault> faults;
  /// Added to the image stamps in the log: the estimator has to find t_imu = t_image - image_stamp_offset.
  Duration image_stamp_offset;
  /// The calibration given is turned: by a rotation vector [deg, body axes] about camera 0's centre
  /// for the whole rig, and about each camera's own centre.
  Eigen::Vector3d rig_turn_deg = Eigen::Vector3d::Zero();
  std::array<Eigen::Vector3d, kMaxCameras> camera_turn_deg{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};

  int threads = 2;
};

}  // namespace swiftlet
