#pragma once
// Generates flight paths: a closed tour flown like a quadrotor, with rest, hover and scanning.
//
// The tour's waypoints are rounded (uniform cubic B-spline, so the path stays inside their hull) and flown
// with varying speed, with small oscillations of position and heading. The thrust axis follows acceleration
// plus gravity, so specific force and attitude are consistent. The result is one SplineTrajectory, which
// gives the truth and its derivatives. Rest is exact: nothing moves during a rest, except for 0.3 s at each
// end that the spline needs. Frames: world z up; flu: forward-left-up axes of the airframe; body = IMU.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "drivers/simulated/spline_trajectory.hpp"

namespace swiftlet {

/// The closed path offered by a world.
struct Tour {
  std::vector<Eigen::Vector3d> waypoints;  ///< at least 4, in order; the last is connected to the first
  double floor = 0;                        ///< height of the floor [m]
};

struct RestPhase {
  double start = 0;     ///< s; the flight slows down in the second before
  double duration = 2;  ///< s
  bool hover = false;   ///< true: a quadrotor's small drift and sway instead of exact rest
};

struct FlightSettings {
  double duration = 60;          ///< s
  double speed = 1.0;            ///< m/s along the tour, mean
  double aggressiveness = 1.0;   ///< scales oscillations of position, heading and speed: 0 calm, 2 fast
  double rest_at_start = 0;      ///< s at rest before the flight; 0: the log begins in motion
  bool start_on_ground = false;  ///< the rest at the start is on the floor, the flight takes off
  std::vector<RestPhase> rests;  ///< further phases, in order, not overlapping
  std::uint64_t seed = 1;        ///< determines the oscillations' phases and the starting point on the tour
  Eigen::Quaterniond R_flu_body = Eigen::Quaterniond::Identity();  ///< IMU axes in the airframe
  double gravity = 9.81;                                           ///< m/s^2
};

/// EuRoC's IMU axes: x up, y right, z forward.
Eigen::Quaterniond eurocBodyAxes();

SplineTrajectory flyTour(const Tour& tour, const FlightSettings& settings);

}  // namespace swiftlet
