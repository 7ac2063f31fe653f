#pragma once
// What is asked of health, judged on flights with truth: for how long an estimate is "good" and wrong, how
// soon and for what share of a healthy flight it is good.

#include <cstdio>
#include <vector>

#include "tests/odometry/faulty_flight.hpp"
#include "tests/odometry/odometry_run.hpp"

namespace swiftlet::test {

struct HealthVerdict {
  RigFault fault = RigFault::kNone;
  bool mono = false;
  double wrong = 0;        ///< s, longest time "good" and wrong
  double first_good = -1;  ///< s since the first image, one camera: since it moves; negative: never
  double good_after = 0;   ///< share of the images from then on
  double good = 0;         ///< share of all images
  double worst_good = 0;   ///< m/s, largest velocity error while good
};

/// Scale of the estimate over the three seconds up to frame `last`, less one; NaN where the motion does not
/// show it.
double scaleError(const std::vector<RunFrame>& frames, std::size_t last);

/// Wrong: velocity off by more than 1 m/s or, with one camera, scale by more than 20 %. `rest`: seconds until
/// the vehicle moves.
HealthVerdict judgeHealth(const std::vector<RunFrame>& frames, double rest, RigFault fault, bool mono);

/// A line a frame, headed by run's number. Any thread may call it.
void writeFramesHeader(std::FILE* csv);
void writeFrames(std::FILE* csv, int run, const std::vector<RunFrame>& frames, RigFault fault, bool mono);

/// Prints the table and the figures asked for. False when one is missed.
bool printHealth(const std::vector<HealthVerdict>& verdicts);

}  // namespace swiftlet::test
