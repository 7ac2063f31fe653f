#pragma once
// A log with poses from another source, for running single modules. Images are paired as in flight.

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
  double max_gap = 0.1;    ///< s, longest gap between poses to interpolate
};

class PosedLog {
 public:
  /// InputError if the log or the poses cannot be read, or if there are neither truth nor a trajectory.
  PosedLog(const PosedLogRequest& request, const Settings& settings);

  [[nodiscard]] LogSource& source() { return *source_; }
  [[nodiscard]] const Rig& rig() const { return source_->rig(); }
  [[nodiscard]] const GivenPoses& poses() const { return poses_; }
  /// Warnings in addition to those of the log itself.
  LogWarnings& warnings() { return warnings_; }
  [[nodiscard]] bool hasTracks() const { return !source_->trackFile().empty(); }

  struct Handlers {
    std::function<void(const StereoFrame&)> frame;
    std::function<void(const TrackedFrame&)> tracks;  ///< empty: a log of tracks has no frames
  };
  /// Prints the warnings on stderr, then passes every frame of the section in order, with progress under the
  /// name `what`. False: stopped before the end.
  bool run(const char* what, const Handlers& handlers);

  /// Stamps of the frames passed.
  [[nodiscard]] std::optional<Stamp> first() const { return first_; }
  [[nodiscard]] std::optional<Stamp> last() const { return last_; }
  /// Fails because no `what` had a pose; `any`: whether there were any.
  [[noreturn]] void failWithoutPose(const char* what, bool any) const;
  /// All warnings, including the log's.
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
