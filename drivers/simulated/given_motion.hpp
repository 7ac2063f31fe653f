#pragma once
// A recorded motion as a trajectory: EuRoC ground truth fitted with a quintic B-spline.
//
// The truth of a simulated flight on it is the spline, so that poses, rates and accelerations are
// consistent with each other to rounding; the spline passes through the recorded poses at every
// knot (kGivenMotionSpacing apart).
// Input: state_groundtruth_estimate0/data.csv of an EuRoC folder (stamp [ns], p xyz, q wxyz, ...;
// further columns are ignored); a name ending in .xz is unpacked on the way.

#include <string>

#include "drivers/simulated/spline_trajectory.hpp"

namespace swiftlet {

/// s; 20 knots a second keep the motion up to about 8 Hz and leave the vicon's jitter out.
inline constexpr double kGivenMotionSpacing = 0.05;

/// Trajectory from the first to the last pose; its time zero is the first pose. With `duration` > 0
/// only [skip, skip + duration] of it. InputError names file and line.
SplineTrajectory readGivenMotion(const std::string& path, double skip = 0, double duration = 0);

}  // namespace swiftlet
