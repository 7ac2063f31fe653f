#pragma once
// The poses of a trajectory at any stamp within it, and where it jumps.
//
// Between two poses at most `max_gap` apart, the pose is interpolated (position linear, rotation by SLERP).
// Two neighbours with an impossible speed between them end one piece of the trajectory and begin the next;
// nothing is interpolated across. Host side.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "drivers/recorded/log_source.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

/// Poses and their source, for messages.
struct NamedTrajectory {
  std::string name;
  Trajectory poses;
};

/// The poses of `file` (TUM, EuRoC csv), or if it is empty the log's own truth. InputError if there are none.
NamedTrajectory openTrajectory(const std::string& file, const std::string& log, const LogSource& source,
                               LogWarnings& warnings);

class GivenPoses {
 public:
  struct Pose {
    SE3 T_world_body;
    std::size_t piece = 0;  ///< number of earlier jumps
  };

  GivenPoses(NamedTrajectory trajectory, Duration max_gap);

  [[nodiscard]] const std::string& name() const { return name_; }

  [[nodiscard]] std::optional<Pose> at(Stamp stamp) const;
  /// The body's motion from half a readout before a stamp to half of one after it; zero without poses around
  /// it.
  [[nodiscard]] ScanMotion scanAt(Stamp stamp, Duration readout) const;
  /// Warns how often the poses jump; `what`: the consequence of each jump.
  void warnOfJumps(const char* what, LogWarnings& warnings) const;
  /// Fails a run in which no `what` had a pose; `first` and `last`: their stamps.
  [[noreturn]] void failWithout(const char* what, Stamp first, Stamp last) const;

 private:
  std::string name_;
  Trajectory trajectory_;  ///< in time order, not empty
  Duration max_gap_;
  std::vector<std::size_t> jumps_;  ///< indices of the poses that begin a piece, except the first
};

}  // namespace swiftlet
