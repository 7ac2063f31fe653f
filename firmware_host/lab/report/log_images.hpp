#pragma once
// The images of a run's log, each at its moment, for pages that show them beside what the run made of them.
//
// Reads through openLog(), whose calibration is taken where it can be read; images are shown without it too.
// Memory: the log's own, and a stamp per image. Cost of an image: one decoding. One thread at a time.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "drivers/recorded/log_source.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/frames.hpp"
#include "firmware_host/lab/report/run_files.hpp"

namespace swiftlet {

class LogImages {
 public:
  /// The images of the run's time. InputError where `log` cannot be opened or has no image of that time.
  LogImages(const std::string& log, bool mono, Stamp first, Stamp last);
  LogImages(const LogImages&) = delete;
  LogImages& operator=(const LogImages&) = delete;

  [[nodiscard]] std::size_t cameras() const { return log_->rig().camera_count; }
  /// Of a log without calibration the size alone is of use.
  [[nodiscard]] const CameraModel& lens(std::size_t camera) const { return log_->rig().camera[camera]; }
  /// In time order.
  [[nodiscard]] const std::vector<Stamp>& stamps(std::size_t camera) const { return stamps_[camera]; }
  /// Null where the log's calibration could not be read.
  [[nodiscard]] const Rig* rig() const { return calibrated_ ? &log_->rig() : nullptr; }
  /// The image of a camera with this stamp, valid until the next call; empty where the log has none or it is
  /// damaged.
  [[nodiscard]] ImageView at(Stamp stamp, std::size_t camera);

 private:
  bool wants(Stamp stamp, std::uint32_t camera);

  std::unique_ptr<LogSource> log_;
  bool calibrated_ = true;
  std::array<std::vector<Stamp>, kMaxCameras> stamps_;
  bool listing_ = true;
  Stamp first_, last_;  ///< of the list
  Stamp wanted_;
  std::size_t wanted_camera_ = 0;
  bool passed_ = false;  ///< a later image of that camera was met
};

/// The log that a run was made from: its own recording, or what its summary names. InputError, with what to
/// do, where there is neither any more.
std::string logOf(const RunFiles& files);

}  // namespace swiftlet
