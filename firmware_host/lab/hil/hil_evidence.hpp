#pragma once
// What a hardware-in-the-loop replay and the flight on it have left in their folders, read for its checks.

#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/nav_state.hpp"
#include "firmware_host/lab/hil/fault_timeline.hpp"

namespace swiftlet {

struct HilEvidence {
  struct Line {
    Stamp stamp;
    std::string text;
  };
  /// A pose and its health.
  struct Judged {
    Stamp stamp;
    SE3 T_world_body;
    Health health = Health::kInitializing;
    std::uint32_t epoch = 0;
  };

  FaultTimeline faults;
  Stamp first_image, last_image;  ///< CLOCK_MONOTONIC, as all stamps here
  bool complete = false;          ///< played to the end, every image when it was due
  bool finished = false;          ///< the flight finished normally
  std::vector<Line> remarks;      ///< of events.log
  std::vector<Judged> frames;     ///< odometry.tum
  std::vector<Judged> states;     ///< imu_rate.tum; empty if the flight did not write it
  Trajectory truth;               ///< empty: the log has none
};

/// `run`: of `swiftlet fly`; `hil`: of `swiftlet hil`. InputError if hil.json, faults.csv or events.log
/// cannot be read; what a broken flight did not write is empty.
HilEvidence readHilEvidence(const std::string& run, const std::string& hil);

}  // namespace swiftlet
