#pragma once
// Relative pose error (RPE): error of the motion over an interval, without any alignment.
//
//   E = (T_truth_i^-1 T_truth_j)^-1 (T_estimate_i^-1 T_estimate_j)
//
// Over time: j is the first pair at least `delta` after i; errors in m and degrees per interval. Over
// distance: j is the first pair at which the truth has flown `length` since i; errors as a percentage of the
// length and in degrees per metre, as in the KITTI and OpenVINS tables. Every pair is a start. A pair is not
// used if j overshoots by more than half the interval (a gap). Sources: Sturm et al., IROS 2012; Geiger et
// al., CVPR 2012; Zhang, Scaramuzza, IROS 2018.

#include <span>
#include <vector>

#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {

struct RelativeError {
  double interval = 0;          ///< s or m
  ErrorStatistics translation;  ///< m over time, percent over distance
  ErrorStatistics rotation;     ///< degrees over time, degrees per metre over distance
};

RelativeError relativeErrorOverTime(std::span<const PosePair> pairs, Duration delta);

RelativeError relativeErrorOverDistance(std::span<const PosePair> pairs, double length);

/// OpenVINS' segment lengths [m]; those longer than the flight have a count of zero.
inline constexpr double kSegmentLengths[] = {8, 16, 24, 32, 40};

}  // namespace swiftlet
