#pragma once
// A recorded motion as a trajectory: EuRoC ground truth fitted with a quintic B-spline.
//
// The spline is the truth of a simulated flight, so poses, rates and accelerations are consistent to
// rounding. It passes through the recorded poses at every knot (kGivenMotionSpacing apart). Input:
// state_groundtruth_estimate0/data.csv of an EuRoC folder (stamp [ns], p xyz, q wxyz, ...; further columns
// are ignored); a name ending in .xz is decompressed.

#include <string>

#include "drivers/simulated/spline_trajectory.hpp"

namespace swiftlet {

/// [s]; 20 knots per second keep motion up to about 8 Hz and remove the Vicon system's jitter.
inline constexpr double kGivenMotionSpacing = 0.05;

/// Trajectory from the first to the last pose; its time zero is the first pose. With `duration` > 0
/// only [skip, skip + duration] of it. InputError names file and line.
SplineTrajectory readGivenMotion(const std::string& path, double skip = 0, double duration = 0);

}  // namespace swiftlet
