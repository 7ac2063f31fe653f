#pragma once
// The images of a run's log at given stamps, for pages that show them with the run's results.
//
// Reads through openLog() and uses the calibration if it can be read; images are shown without it too.
// Memory: the log's own, and one stamp per image. Cost of an image: decoding it once. One thread at a time.

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
  /// Lists the images during the run. InputError if `log` cannot be opened or has no image in that time.
  LogImages(const std::string& log, bool mono, Stamp first, Stamp last);
  LogImages(const LogImages&) = delete;
  LogImages& operator=(const LogImages&) = delete;

  [[nodiscard]] std::size_t cameras() const { return log_->rig().camera_count; }
  /// For a log without calibration, only the size is valid.
  [[nodiscard]] const CameraModel& lens(std::size_t camera) const { return log_->rig().camera[camera]; }
  /// In time order.
  [[nodiscard]] const std::vector<Stamp>& stamps(std::size_t camera) const { return stamps_[camera]; }
  /// Null if the log's calibration could not be read.
  [[nodiscard]] const Rig* rig() const { return calibrated_ ? &log_->rig() : nullptr; }
  /// The image of a camera with this stamp, valid until the next call; empty if the log has none or if it is
  /// damaged.
  [[nodiscard]] ImageView at(Stamp stamp, std::size_t camera);

 private:
  bool wants(Stamp stamp, std::uint32_t camera);

  std::unique_ptr<LogSource> log_;
  bool calibrated_ = true;
  std::array<std::vector<Stamp>, kMaxCameras> stamps_;
  bool listing_ = true;
  Stamp first_, last_;  ///< bounds of the list
  Stamp wanted_;
  std::size_t wanted_camera_ = 0;
  bool passed_ = false;  ///< a later image of that camera was read
};

/// The log of a run: its own recording, or the log named in its summary. InputError with the remedy if
/// neither exists any more.
std::string logOf(const RunFiles& files);

}  // namespace swiftlet
