#pragma once
// The poses of a trajectory at any stamp within it, and where it jumps.
//
// Between two poses at most `max_gap` apart the pose is interpolated (position linear, rotation by SLERP).
// Two neighbours that nothing flies or turns between so fast end one piece of the trajectory and begin the
// next; nothing is interpolated across. Host side.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "drivers/recorded/log_source.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

/// Poses, and where they are from: for messages.
struct NamedTrajectory {
  std::string name;
  Trajectory poses;
};

/// Those of `file` (TUM, EuRoC csv), or where it is empty the log's own truth. InputError if there are
/// none.
NamedTrajectory openTrajectory(const std::string& file, const std::string& log, const LogSource& source,
                               LogWarnings& warnings);

class GivenPoses {
 public:
  struct Pose {
    SE3 T_world_body;
    std::size_t piece = 0;  ///< counts the jumps before it
  };

  GivenPoses(NamedTrajectory trajectory, Duration max_gap);

  [[nodiscard]] const std::string& name() const { return name_; }

  [[nodiscard]] std::optional<Pose> at(Stamp stamp) const;
  /// How the body moved between half a readout before a stamp and half of one after it; zero where there are
  /// no poses about it.
  [[nodiscard]] ScanMotion scanAt(Stamp stamp, Duration readout) const;
  /// Where the poses jump: how often, and `what` each jump does.
  void warnOfJumps(const char* what, LogWarnings& warnings) const;
  /// Refuses a run in which no `what`, the first and last of which were at these stamps, had a pose.
  [[noreturn]] void failWithout(const char* what, Stamp first, Stamp last) const;

 private:
  std::string name_;
  Trajectory trajectory_;  ///< in time order, not empty
  Duration max_gap_;
  std::vector<std::size_t> jumps_;  ///< indices of the poses that begin a piece, without the first
};

}  // namespace swiftlet
