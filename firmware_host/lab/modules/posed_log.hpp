#pragma once
// A log beside poses that something else gave of it: what the modules run alone on. Images are paired as in
// flight.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "estimator/messages/frames.hpp"
#include "firmware_host/inputs/log/log_request.hpp"
#include "firmware_host/lab/modules/given_poses.hpp"

namespace swiftlet {

struct PosedLogRequest : LogRequest {
  std::string trajectory;  ///< TUM, EuRoC csv; empty: the log's own truth
  double max_gap = 0.1;    ///< s between poses, to interpolate
};

class PosedLog {
 public:
  /// InputError if the log or the poses cannot be read, or a log has neither truth nor a trajectory.
  PosedLog(const PosedLogRequest& request, const Settings& settings);

  [[nodiscard]] LogSource& source() { return *source_; }
  [[nodiscard]] const Rig& rig() const { return source_->rig(); }
  [[nodiscard]] const GivenPoses& poses() const { return poses_; }
  /// What comes up beside those of the log itself.
  LogWarnings& warnings() { return warnings_; }
  [[nodiscard]] bool hasTracks() const { return !source_->trackFile().empty(); }

  struct Handlers {
    std::function<void(const StereoFrame&)> frame;
    std::function<void(const TrackedFrame&)> tracks;  ///< empty: a log of tracks has no frames
  };
  /// Says the warnings on stderr, then gives every frame of the section in order, with progress under the
  /// name `what`. False: stopped before the end.
  bool run(const char* what, const Handlers& handlers);

  /// Of the frames given.
  [[nodiscard]] std::optional<Stamp> first() const { return first_; }
  [[nodiscard]] std::optional<Stamp> last() const { return last_; }
  /// No `what` had a pose (`any`: there were some).
  [[noreturn]] void failWithoutPose(const char* what, bool any) const;
  /// The log's, and the others.
  [[nodiscard]] nlohmann::ordered_json warningsJson() const;

 private:
  void give(const Handlers& handlers, const StereoFrame& frame);

  const PosedLogRequest& request_;
  PairingSettings pairing_;
  std::unique_ptr<LogSource> source_;
  LogWarnings warnings_;
  GivenPoses poses_;
  std::optional<Stamp> first_, last_;
};

}  // namespace swiftlet
