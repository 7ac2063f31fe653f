#pragma once
// Reads for the checks what a hardware-in-the-loop replay and the flight on it left in their folders.

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
  bool complete = false;          ///< played to the end, with every image at its due time
  bool finished = false;          ///< the flight finished normally
  std::vector<Line> remarks;      ///< from events.log
  std::vector<Judged> frames;     ///< from odometry.tum
  std::vector<Judged> states;     ///< from imu_rate.tum; empty if the flight did not write it
  Trajectory truth;               ///< empty: the log has none
};

/// `run`: folder of `swiftlet fly`; `hil`: folder of `swiftlet hil`. InputError if hil.json, faults.csv or
/// events.log cannot be read; what a broken flight did not write is empty.
HilEvidence readHilEvidence(const std::string& run, const std::string& hil);

}  // namespace swiftlet
