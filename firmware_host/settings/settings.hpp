#pragma once
// The settings tree of the program with its defaults.
//
// registry.cpp lists every setting with key, unit, bounds and description; reader, printer and checks use
// only that table.

#include <string>

#include "estimator/messages/effort.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/settings/device_settings.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/map/map_settings.hpp"

namespace swiftlet {

struct PairingGroup {
  double tolerance_ms = 2.5;
  double patience_ms = 50;

  [[nodiscard]] PairingSettings of(std::size_t cameras) const {
    PairingSettings result;
    result.cameras = cameras;
    result.tolerance = Duration::fromSeconds(tolerance_ms * 1e-3);
    result.patience = Duration::fromSeconds(patience_ms * 1e-3);
    return result;
  }
};

struct CalibrationGroup {
  bool accept_unusual_rig = false;
};

struct EvaluationGroup {
  double max_gap_ms = 20;
  double rpe_delta_s = 1.0;
};

/// For `fly` without --out.
struct FlightsGroup {
  std::string folder = "flights";
  int keep_free_mib = 0;  ///< 0: nothing is ever deleted
  bool smooth = false;
};

struct MeshGroup {
  bool enabled = true;
};

struct LoopGroup {
  bool enabled = false;
  std::string vocabulary = "";  ///< file; empty: the shipped one
  std::string in_map = "";      ///< folder of a kept map in which the run is located; empty: none
  bool extend_map = false;      ///< add keyframes to the kept map
};

struct MapGroup {
  bool enabled = false;
  bool depth_sensor = true;
  std::string confusion = "";  ///< file; empty: map.label_certainty
};

/// SCHED_FIFO priorities, 1 to 98; 0: SCHED_OTHER. All are below 50, the priority at which PREEMPT_RT kernels
/// run interrupt handlers, without which no sample arrives.
struct RealtimeGroup {
  bool enabled = true;
  bool lock_memory = true;
  int sensor_priority = 45;
  int propagate_priority = 40;
  int track_priority = 30;
  int smooth_priority = 20;
  int mesh_priority = 15;
  int low_priority = 0;
  int sensor_cpu = -1;
  int propagate_cpu = -1;
  int track_cpu = -1;
  int smooth_cpu = -1;
  int mesh_cpu = -1;
  int low_cpu = -1;
};

/// Milliseconds of the thread's CPU time; wall time if the name contains wall.
struct BudgetsGroup {
  double propagate_p50_ms = 0.02;
  double propagate_p99_ms = 0.05;
  double propagate_max_ms = 1;
  double track_p50_ms = 3.5;
  double track_p99_ms = 9;
  double track_max_ms = 20;
  double smooth_p50_ms = 2.5;
  double smooth_p99_ms = 6;
  double smooth_max_ms = 15;
  double mesh_p50_ms = 1;
  double mesh_p99_ms = 3;
  double mesh_max_ms = 8;
  double image_to_pose_p50_ms = 6;
  double image_to_pose_p99_ms = 15;
  double image_to_pose_max_ms = 35;
  double image_to_pose_spread = 2.5;
  double image_to_pose_wall_p99_ms = 50;
  double image_to_pose_wall_max_ms = 100;
  double sample_to_state_p50_ms = 0.02;
  double sample_to_state_p99_ms = 0.05;
  double sample_to_state_wall_p99_ms = 5;
  double sample_to_state_wall_max_ms = 20;
};

struct Settings {
  VehicleGroup vehicle;
  ImuLinkGroup imu_link;
  CamerasGroup cameras;
  TriggerGroup trigger;
  HilGroup hil;
  AutopilotGroup autopilot;
  Ros2Group ros2;
  OdometrySettings odometry;
  Effort effort;
  PairingGroup pairing;
  CalibrationGroup calibration;
  EvaluationGroup evaluation;
  FlightsGroup flights;
  MeshGroup mesh;
  LoopGroup loop;
  LoopSettings loop_stage;
  MapGroup map;
  MapSettings map_stage;
  RealtimeGroup realtime;
  BudgetsGroup budgets;
  bool full_smoothing = true;  ///< true if smoother.horizon is `full`
  int full_memory_mib = 2048;  ///< memory limit of full smoothing
};

}  // namespace swiftlet
