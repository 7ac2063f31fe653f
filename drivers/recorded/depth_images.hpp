#pragma once
// The depth images of a log: `mav0/depth0`, a folder like a camera's with data.csv, 16-bit grey PNG and a
// sensor.yaml (drivers/calibration/depth_sensor.hpp). Some frames may have none.
//
// Host side: opening allocates and throws InputError. at() decodes into one buffer, valid until the next
// call.

#include <string>
#include <vector>

#include "drivers/calibration/depth_sensor.hpp"
#include "drivers/image/image_decoder.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/log_warnings.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

class DepthImages {
 public:
  /// `log`: the sequence, its mav0 or an archive; if it has no depth images, at() never returns one.
  /// `T_body_filebody`: from the log's calibration, if the IMU is not the file's body.
  DepthImages(const std::string& log, LogWarnings& warnings, const SE3& T_body_filebody = {});

  /// The image with exactly this stamp, in metres; `depth` is null if there is none. Missing, damaged or
  /// wrongly sized files are reported, counted and skipped.
  DepthImageView at(Stamp stamp);

  [[nodiscard]] bool empty() const { return rows_.empty(); }
  [[nodiscard]] const std::vector<ImageRow>& rows() const { return rows_; }
  [[nodiscard]] const DepthSensor& sensor() const { return sensor_; }
  [[nodiscard]] const LogCounters& counters() const { return counters_; }

 private:
  AslFiles files_;
  LogWarnings& warnings_;
  LogCounters counters_;
  std::vector<ImageRow> rows_;  ///< by stamp
  DepthSensor sensor_;
  ImageDecoder decoder_;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint16_t> units_;
  std::vector<float> depth_;
};

}  // namespace swiftlet
