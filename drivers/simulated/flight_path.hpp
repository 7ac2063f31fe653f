#pragma once
// Own flight paths: a closed tour flown as a quadrotor would, with rest, hover and scanning.
//
// What: the tour's waypoints are rounded off (uniform cubic B-spline, so the path stays inside
// their hull), flown with varying speed, with small oscillations of position and heading on top.
// The thrust axis follows acceleration plus gravity, so specific force and attitude fit together.
// All of it is then one SplineTrajectory: truth and its derivatives are that spline's.
// Rest is exact: between a rest's begin and end nothing moves, but for 0.3 s at each end that the
// spline needs.
// Frames: world z up; flu: forward-left-up axes of the airframe; body = IMU.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "drivers/simulated/spline_trajectory.hpp"

namespace swiftlet {

/// The closed path that a world offers to fly along.
struct Tour {
  std::vector<Eigen::Vector3d> waypoints;  ///< at least 4, in order; the last joins the first
  double floor = 0;                        ///< height of the floor [m]
};

struct RestPhase {
  double start = 0;     ///< s; the flight slows down in the second before
  double duration = 2;  ///< s
  bool hover = false;   ///< with a quadrotor's small drift and sway in place of none
};

struct FlightSettings {
  double duration = 60;          ///< s
  double speed = 1.0;            ///< m/s along the tour, in the mean
  double aggressiveness = 1.0;   ///< scales oscillation of position, heading and speed: 0 calm, 2 fast
  double rest_at_start = 0;      ///< s at rest before the flight; 0: the log begins in motion
  bool start_on_ground = false;  ///< the rest at the start is on the floor, the flight takes off
  std::vector<RestPhase> rests;  ///< further phases, in order, not overlapping
  std::uint64_t seed = 1;        ///< phases of the oscillations and where on the tour it begins
  Eigen::Quaterniond R_flu_body = Eigen::Quaterniond::Identity();  ///< IMU axes in the airframe
  double gravity = 9.81;                                           ///< m/s^2
};

/// EuRoC's IMU axes: x up, y right, z forward.
Eigen::Quaterniond eurocBodyAxes();

SplineTrajectory flyTour(const Tour& tour, const FlightSettings& settings);

}  // namespace swiftlet
